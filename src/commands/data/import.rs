//! `isoflop data import`: motion of other layouts and skeletons as a data set.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use isoflop::data::import::{
    self, Form, GroupBy, ImportError, ImportOptions, Imported, Rate, SHORTEST, Skeleton,
};
use isoflop::data::{Split, parse_annotation, read_motion};
use isoflop::figures::motion::{CaptionedMotion, write_sheet};
use isoflop::files::atomic;
use isoflop::motion::retarget::Up;
use isoflop::units::quoted;
use serde_json::{Value, json};

use crate::commands::exit::Exit;
use crate::commands::output::Output;

#[derive(Args)]
pub struct ImportArgs {
    /// The folder of motions; those in folders below it are read too
    #[arg(value_name = "DIR")]
    from: PathBuf,
    /// What the files hold
    #[arg(long = "from", value_name = "FORM")]
    form: FormName,
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
    #[arg(long, value_name = "BY")]
    group: Option<GroupName>,
    /// Replace a data set that was imported
    #[arg(long)]
    overwrite: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum FormName {
    /// BVH of any human hierarchy
    Bvh,
    /// .npy of T × 22 × 3, HumanML3D's joints
    Joints,
    /// .npy of T × J × 3, of which the first 22 are SMPL's body
    SmplxJoints,
    /// KIT-ML: .npy of T × 21 × 3 or T × 251, or its folder
    Kit,
}

#[derive(Clone, Copy, ValueEnum)]
enum GroupName {
    /// Files of one folder
    Folder,
    /// Files whose names differ in their last number alone
    Name,
    /// Files whose names agree up to the first _
    Prefix,
    /// Each file by itself
    File,
}

fn rate(text: &str) -> Result<Rate, String> {
    if text == "keep" { Ok(Rate::Kept) } else { fps(text).map(Rate::Fixed) }
}

fn fps(text: &str) -> Result<f64, String> {
    let fps: f64 = text.parse().map_err(|_| "is no number".to_string())?;
    let sensible = (1.0..=1000.0).contains(&fps);
    sensible.then_some(fps).ok_or_else(|| "frames a second are from 1 to 1000".to_string())
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
        form: match args.form {
            FormName::Bvh => Form::Bvh,
            FormName::Joints => Form::Joints,
            FormName::SmplxJoints => Form::SmplxJoints,
            FormName::Kit => Form::Kit,
        },
        map,
        up: args.up,
        left_handed: args.left_handed,
        fps: args.fps,
        rate: args.rate,
        texts: args.texts.clone(),
        caption: args.caption.clone(),
        group: args.group.map(|group| match group {
            GroupName::Folder => GroupBy::Folder,
            GroupName::Name => GroupBy::Name,
            GroupName::Prefix => GroupBy::Prefix,
            GroupName::File => GroupBy::File,
        }),
        overwrite: args.overwrite,
    })
}

/// Problems that are told, at most.
const TOLD: usize = 12;

fn tell(imported: &Imported, args: &ImportArgs, output: &Output) {
    let limit = if output.full { usize::MAX } else { TOLD };
    imported.problems.iter().take(limit).for_each(|problem| output.warn(problem));
    if imported.problems.len() > limit {
        output.note(&format!("and {} more: --full", imported.problems.len() - limit));
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
    for (split, count) in Split::ALL.iter().zip(imported.splits) {
        let (clips, groups, hours) = (count.clips, count.groups, hours(count.frames, imported.fps));
        let _ =
            writeln!(text, "  {:<6}{clips:>6} clips  {groups:>5} groups  {hours}", split.name());
    }
    for skeleton in &imported.skeletons {
        let Skeleton { joints, files, up, neutral, .. } = skeleton;
        let noun = if *files == 1 { "file" } else { "files" };
        let _ = writeln!(text, "\nskeleton of {} joints, {files} {noun}, {up} up", joints.len());
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
