//! `isoflop data import`: motion of other layouts and skeletons as a data set.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use isoflop::data::import::{
    self, Form, GroupBy, ImportError, ImportOptions, Imported, Rate, SHORTEST, Skeleton,
};
use isoflop::data::{Split, parse_annotation, read_motion};
use isoflop::figures::motion::{CaptionedMotion, write_sheet};
use isoflop::files::atomic;
use isoflop::motion::retarget::Up;
use isoflop::units::quoted;
use serde_json::{Value, json};

use crate::commands::args::{number, one_of};
use crate::commands::exit::Exit;
use crate::commands::output::Output;
use crate::commands::screen::{many, more, table};

#[derive(Args)]
pub struct ImportArgs {
    /// The folder of motions; those in folders below it are read too
    #[arg(value_name = "DIR")]
    from: PathBuf,
    /// What the files hold
    #[arg(long = "from", value_name = "FORM", value_parser = one_of(FORMS))]
    form: Form,
    /// The data set to write
    #[arg(long, value_name = "DATA")]
    out: PathBuf,
    /// Names of joints, a line each, as `left_hip: LeftUpLeg`; a draft is written where one is needed
    #[arg(long, value_name = "FILE")]
    map: Option<PathBuf>,
    /// The axis that points up: x, y, z, -x, -y or -z; by default that along which bodies stand
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    up: Option<Up>,
    /// The files' axes are left-handed
    #[arg(long)]
    left_handed: bool,
    /// Frames a second of .npy files; those of BVH files are in them
    #[arg(long, value_parser = fps)]
    fps: Option<f64>,
    /// Frames a second of the data set: a number, or `keep` for those of the files
    #[arg(long, value_parser = rate, default_value = "20")]
    rate: Rate,
    /// A folder with NAME.txt for each motion; by default that beside it, or words of its name
    #[arg(long, value_name = "DIR")]
    texts: Option<PathBuf>,
    /// The caption of motions that have none
    #[arg(long, value_name = "TEXT", default_value = "a person moves")]
    caption: String,
    /// What stays in one split; by default folders, or names up to their last number
    #[arg(long, value_name = "BY", value_parser = one_of(GROUPS))]
    group: Option<GroupBy>,
    /// Replace a data set that was imported
    #[arg(long)]
    overwrite: bool,
}

const FORMS: [(&str, &str, Form); 4] = [
    ("bvh", "BVH of any human hierarchy", Form::Bvh),
    ("joints", ".npy of T × 22 × 3, HumanML3D's joints", Form::Joints),
    ("smplx-joints", ".npy of T × J × 3, of which the first 22 are SMPL's body", Form::SmplxJoints),
    ("kit", "KIT-ML: .npy of T × 21 × 3 or T × 251, or its folder", Form::Kit),
];

const GROUPS: [(&str, &str, GroupBy); 4] = [
    ("folder", "Files of one folder", GroupBy::Folder),
    ("name", "Files whose names differ in their last number alone", GroupBy::Name),
    ("prefix", "Files whose names agree up to the first _", GroupBy::Prefix),
    ("file", "Each file by itself", GroupBy::File),
];

fn rate(text: &str) -> Result<Rate, String> {
    if text == "keep" { Ok(Rate::Kept) } else { fps(text).map(Rate::Fixed) }
}

fn fps(text: &str) -> Result<f64, String> {
    number(text, |fps| (1.0..=1000.0).contains(&fps), "a number of frames a second, 1 to 1000")
}

/// The file in the data set that shows some of its motions.
const SHEET: &str = "contact.png";

/// Motions on the sheet, at most.
const SHOWN: usize = 16;

pub fn import(args: &ImportArgs, output: &Output) -> Result<Exit> {
    let options = options(args)?;
    let imported = import::import(&options, &args.out);
    let imported = imported.inspect_err(|error| {
        if let ImportError::NothingUsable { draft: Some(draft), .. } = error {
            write_draft(draft, args, output);
        }
    })?;
    tell(&imported, args, output);
    sheet(&args.out, imported.fps).context("drawing the contact sheet")?;
    output.result(&document(&imported, args), &text(&imported, args))?;
    Ok(if imported.problems.is_empty() { Exit::Done } else { Exit::SomeRunsFailed })
}

fn options(args: &ImportArgs) -> Result<ImportOptions> {
    let map = args.map.as_deref().map(import::read_map).transpose()?.unwrap_or_default();
    Ok(ImportOptions {
        from: args.from.clone(),
        form: args.form,
        map,
        up: args.up,
        left_handed: args.left_handed,
        fps: args.fps,
        rate: args.rate,
        texts: args.texts.clone(),
        caption: args.caption.clone(),
        group: args.group,
        overwrite: args.overwrite,
    })
}

/// Problems that are told, at most.
const TOLD: usize = 12;

fn tell(imported: &Imported, args: &ImportArgs, output: &Output) {
    let limit = if output.full { usize::MAX } else { TOLD };
    imported.problems.iter().take(limit).for_each(|problem| output.warn(problem));
    let unsaid = more(imported.problems.len(), limit, ": --full");
    if !unsaid.is_empty() {
        output.note(unsaid.trim());
    }
    if let Some(draft) = &imported.draft {
        write_draft(draft, args, output);
    }
    if imported.uncaptioned > 0 {
        let (n, caption) = (imported.uncaptioned, &args.caption);
        output.warn(&format!("{n} clips have no caption of their own; theirs is {caption:?}"));
    }
}

/// Writes a mapping to fill in, unless there is one.
fn write_draft(draft: &str, args: &ImportArgs, output: &Output) {
    let path = args.out.with_extension("map.yaml");
    if path.exists() {
        return output.note(&format!("fill in {} and give it as --map", path.display()));
    }
    match atomic::write_bytes(&path, draft.as_bytes()) {
        Ok(()) => output.note(&format!(
            "a draft of a mapping is {}; fill it in and give --map",
            path.display()
        )),
        Err(error) => output.warn(&error.to_string()),
    }
}

/// Clips of the training split at even distances, with their first captions.
fn sheet(folder: &Path, fps: f64) -> Result<()> {
    let list = fs::read_to_string(folder.join("train.txt"))?;
    let ids: Vec<&str> = list.lines().collect();
    let clip = |id: &&str| -> Result<(Vec<f32>, String)> {
        let features = read_motion(&folder.join(format!("new_joint_vecs/{id}.npy")), fps)?;
        let lines = fs::read_to_string(folder.join(format!("texts/{id}.txt")))?;
        let caption = parse_annotation(lines.lines().next().unwrap_or_default())?.caption;
        Ok((features, format!("{id}: {caption}")))
    };
    let step = ids.len().div_ceil(SHOWN).max(1);
    let clips: Vec<(Vec<f32>, String)> =
        ids.iter().step_by(step).map(clip).collect::<Result<_>>()?;
    let motions = clips.iter().map(|(features, caption)| CaptionedMotion {
        features,
        caption,
        fps: fps as f32,
    });
    Ok(write_sheet(&folder.join(SHEET), &motions.collect::<Vec<_>>())?)
}

fn document(imported: &Imported, args: &ImportArgs) -> Value {
    let [train, val, test] = imported.splits;
    json!({
        "data": args.out,
        "fps": imported.fps,
        "train": train, "val": val, "test": test,
        "too_short": imported.too_short,
        "captioned_by_name": imported.captioned_by_name,
        "uncaptioned": imported.uncaptioned,
        "problems": imported.problems,
        "skeletons": imported.skeletons,
    })
}

fn text(imported: &Imported, args: &ImportArgs) -> String {
    let mut text = String::new();
    let frames: usize = imported.splits.iter().map(|split| split.frames).sum();
    let clips: usize = imported.splits.iter().map(|split| split.clips).sum();
    let _ = writeln!(text, "{clips} clips, {}", hours(frames, imported.fps));
    let rows = Split::ALL.iter().zip(imported.splits).map(|(split, count)| {
        let (clips, groups) =
            (format!("{} clips", count.clips), format!("{} groups", count.groups));
        [format!("  {}", split.name()), clips, groups, hours(count.frames, imported.fps)]
    });
    text += &table(["<", "", "", "<"], rows);
    for skeleton in &imported.skeletons {
        let Skeleton { joints, files, up, neutral, .. } = skeleton;
        let files = many(*files, "file");
        let _ = writeln!(
            text,
            "
skeleton of {} joints, {files}, {up} up",
            joints.len()
        );
        let _ = writeln!(text, "  upright in {neutral}");
    }
    if imported.too_short > 0 {
        let (n, shortest_s) = (imported.too_short, (SHORTEST - 1) as f64 / imported.fps);
        let _ = writeln!(text, "\n{n} motions are shorter than {shortest_s:.1} s: left out");
    }
    let out = args.out.display().to_string();
    let _ = writeln!(text, "\nlook at  {}", args.out.join(SHEET).display());
    let _ = writeln!(text, "next     isoflop run own-data --set data.path={}", quoted(&out));
    text
}

fn hours(frames: usize, fps: f64) -> String {
    let minutes = frames as f64 / fps / 60.0;
    if minutes < 120.0 { format!("{minutes:.1} min") } else { format!("{:.1} h", minutes / 60.0) }
}
