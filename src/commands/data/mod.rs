//! `isoflop data`: makes, checks and counts data sets.

mod check;

pub use check::too_few;

use super::args::{number, one_of};
use super::prelude::*;
use clap::Subcommand;
use isoflop::data::import::{
    self, Form, GroupBy, ImportError, ImportOptions, Imported, Rate, SHORTEST, Skeleton,
    write_procedural,
};
use isoflop::data::{
    Counted, HumanMl3d, HumanMl3dOptions, MotionSource, Procedural, ProceduralOptions, Split,
    Tally, count, parse_annotation, read_motion,
};
use isoflop::figures::motion::{CaptionedMotion, write_sheet};
use isoflop::motion::retarget::Up;
use isoflop::units::quoted;
use std::fs;

#[derive(Args)]
pub struct DataArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Make a data set from BVH files or joints: retarget, resample, cut, caption, split
    Import(ImportArgs),
    /// Check every file of a data set and report all problems
    Check(check::CheckArgs),
    /// Count a data set: clips, hours, tokens, captions, words
    Stats(StatsArgs),
    /// Write the built-in procedural motion as a data set
    Synth(SynthArgs),
}

pub fn data(args: &DataArgs, output: &Output) -> Result<Exit> {
    match &args.what {
        What::Import(args) => import(args, output),
        What::Check(args) => check::check(args, output),
        What::Stats(args) => stats(args, output),
        What::Synth(args) => synth(args, output),
    }
}

// `isoflop data synth`: the built-in procedural motion as a data set.

#[derive(Args)]
struct SynthArgs {
    /// The data set to write
    #[arg(long, value_name = "DATA")]
    out: PathBuf,
    /// Clips to train on
    #[arg(long, default_value_t = 1024)]
    clips: usize,
    /// Clips to validate on
    #[arg(long, default_value_t = 64)]
    val_clips: usize,
    /// Clips to test on
    #[arg(long, default_value_t = 128)]
    test_clips: usize,
    /// Seed of the generated clips
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Replace a data set made by this command
    #[arg(long)]
    overwrite: bool,
}

fn synth(args: &SynthArgs, output: &Output) -> Result<Exit> {
    let SynthArgs { seed, clips: train_clips, val_clips, test_clips, .. } = *args;
    let options = ProceduralOptions { seed, train_clips, val_clips, test_clips };
    let written = write_procedural(&Procedural::new(options), &args.out, args.overwrite)?;
    written.problems.iter().for_each(|problem| output.warn(problem));
    let [train, val, test] = written.splits;
    let text = format!(
        "{}: {}, {} and {} clips to train, validate and test on",
        args.out.display(),
        train.clips,
        val.clips,
        test.clips
    );
    output.result(&json!({ "data": args.out, "train": train, "val": val, "test": test }), &text)
}

// `isoflop data stats`: counts a data set.

#[derive(Args)]
struct StatsArgs {
    /// A folder in the HumanML3D layout
    data: PathBuf,
    /// Count the mirror image of every training clip too, as sweeps do by default
    #[arg(long)]
    mirror: bool,
}

fn stats(args: &StatsArgs, output: &Output) -> Result<Exit> {
    let options = HumanMl3dOptions { mirror: args.mirror, ..HumanMl3dOptions::default() };
    let data = HumanMl3d::open(&args.data, &options)?;
    let left_out = data.warnings().len();
    let counted = count(&data);
    output.result(&json!({ "counted": counted, "left_out": left_out }), &text(&counted, left_out))
}

fn text(counted: &Counted, left_out: usize) -> String {
    let Counted { train, val, test, all, .. } = counted;
    let row = |(name, tally): (&str, &Tally)| {
        let Tally { clips, frames, tokens, captions, distinct_captions, words, .. } = tally;
        let at = |rate: usize| tokens.get(&rate).copied().unwrap_or(0);
        let counts = [at(1), at(2), at(4), *captions, *distinct_captions, *words];
        let [one, two, four, captions, distinct, words] = counts.map(|n| n.to_string());
        let [clips, frames, hours] =
            [clips.to_string(), frames.to_string(), format!("{:.2}", tally.hours)];
        [name.to_string(), clips, frames, hours, one, two, four, captions, distinct, words]
    };
    let rows = [("train", train), ("val", val), ("test", test), ("all", all)];
    let codes = "codes at 1";
    let heads = [
        "<split", "clips", "frames", "hours", codes, "2", "4 frames", "captions", "distinct",
        "words",
    ];
    let mut text = table(heads, rows.map(row));
    let _ = writeln!(text, "\n{:.1} words a caption", counted.all.words_a_caption);
    text += "\nclips by frames\n";
    bars(&mut text, &counted.lengths, isoflop::data::LENGTH_BIN);
    text += "\ncaptions by words\n";
    bars(&mut text, &counted.caption_words, isoflop::data::WORDS_BIN);
    if left_out > 0 {
        let _ = writeln!(text, "\n{left_out} clips or parts are left out: isoflop data check");
    }
    text
}

/// Characters of the longest bar.
const WIDTH: usize = 50;

fn bars(text: &mut String, bins: &BTreeMap<usize, usize>, width: usize) {
    let most = bins.values().max().copied().unwrap_or(1).max(1);
    let row = |(first, count): (&usize, &usize)| {
        let bar = "#".repeat((count * WIDTH).div_ceil(most));
        [format!("  {first} to {}", first + width - 1), count.to_string(), bar]
    };
    *text += &table(["<", "", "<"], bins.iter().map(row));
}

// `isoflop data import`: makes a data set from motion in other layouts and skeletons.

#[derive(Args)]
struct ImportArgs {
    /// The folder of motions, read with its subfolders
    #[arg(value_name = "DIR")]
    from: PathBuf,
    /// The format of the files
    #[arg(long = "from", value_name = "FORM", value_parser = one_of(FORMS))]
    form: Form,
    /// The data set to write
    #[arg(long, value_name = "DATA")]
    out: PathBuf,
    /// File of joint names, one per line, e.g. `left_hip: LeftUpLeg`; a draft is written if needed
    #[arg(long, value_name = "FILE")]
    map: Option<PathBuf>,
    /// The axis that points up: x, y, z, -x, -y or -z; by default the axis along which bodies stand
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    up: Option<Up>,
    /// The files' axes are left-handed
    #[arg(long)]
    left_handed: bool,
    /// Frames per second of .npy files; BVH files contain theirs
    #[arg(long, value_parser = fps)]
    fps: Option<f64>,
    /// Frames per second of the data set: a number, or `keep` for the rate of the files
    #[arg(long, value_parser = rate, default_value = "20")]
    rate: Rate,
    /// A folder with NAME.txt for each motion; by default the .txt next to it, or words of its name
    #[arg(long, value_name = "DIR")]
    texts: Option<PathBuf>,
    /// The caption of motions without one
    #[arg(long, value_name = "TEXT", default_value = "a person moves")]
    caption: String,
    /// Groups of files that stay in one split; by default by folder, or by name up to its last number
    #[arg(long, value_name = "BY", value_parser = one_of(GROUPS))]
    group: Option<GroupBy>,
    /// Replace an imported data set
    #[arg(long)]
    overwrite: bool,
}

const FORMS: [(&str, &str, Form); 4] = [
    ("bvh", "BVH of any human hierarchy", Form::Bvh),
    ("joints", ".npy of T × 22 × 3, HumanML3D's joints", Form::Joints),
    ("smplx-joints", ".npy of T × J × 3, the first 22 joints SMPL's body", Form::SmplxJoints),
    ("kit", "KIT-ML: .npy of T × 21 × 3 or T × 251, or its folder", Form::Kit),
];

const GROUPS: [(&str, &str, GroupBy); 4] = [
    ("folder", "Files of one folder", GroupBy::Folder),
    ("name", "Files whose names differ only in their last number", GroupBy::Name),
    ("prefix", "Files whose names agree up to the first _", GroupBy::Prefix),
    ("file", "Each file by itself", GroupBy::File),
];

fn rate(text: &str) -> Result<Rate, String> {
    if text == "keep" { Ok(Rate::Kept) } else { fps(text).map(Rate::Fixed) }
}

fn fps(text: &str) -> Result<f64, String> {
    number(text, |fps| (1.0..=1000.0).contains(&fps), "a number of frames a second, 1 to 1000")
}

/// The contact sheet in the data set.
const SHEET: &str = "contact.png";

/// Motions on the sheet, at most.
const SHOWN: usize = 16;

fn import(args: &ImportArgs, output: &Output) -> Result<Exit> {
    let options = options(args)?;
    let imported = import::import(&options, &args.out);
    let imported = imported.inspect_err(|error| {
        if let ImportError::NothingUsable { draft: Some(draft), .. } = error {
            write_draft(draft, args, output);
        }
    })?;
    tell(&imported, args, output);
    sheet(&args.out, imported.fps).context("drawing the contact sheet")?;
    let [train, val, test] = imported.splits;
    let document = json!({
        "data": args.out, "fps": imported.fps, "train": train, "val": val, "test": test,
        "too_short": imported.too_short, "captioned_by_name": imported.captioned_by_name,
        "uncaptioned": imported.uncaptioned, "problems": imported.problems,
        "remarks": imported.remarks,
        "skeletons": imported.skeletons,
    });
    output.result(&document, &text_import(&imported, args))?;
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

/// Most problems that are shown.
const TOLD: usize = 12;

fn tell(imported: &Imported, args: &ImportArgs, output: &Output) {
    let limit = if output.full { usize::MAX } else { TOLD };
    for told in [&imported.problems, &imported.remarks] {
        told.iter().take(limit).for_each(|line| output.warn(line));
        let unsaid = more(told.len(), limit, ": --full");
        if !unsaid.is_empty() {
            output.note(unsaid.trim());
        }
    }
    if let Some(draft) = &imported.draft {
        write_draft(draft, args, output);
    }
    if imported.uncaptioned > 0 {
        let (n, caption) = (imported.uncaptioned, &args.caption);
        output.warn(&format!("{n} clips have no caption; they get {caption:?}"));
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

fn text_import(imported: &Imported, args: &ImportArgs) -> String {
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
        let n = joints.len();
        let _ =
            writeln!(text, "\nskeleton of {n} joints, {files}, {up} up\n  upright in {neutral}");
    }
    if imported.too_short > 0 {
        let (n, shortest_s) = (imported.too_short, (SHORTEST - 1) as f64 / imported.fps);
        let _ = writeln!(text, "\n{n} motions are shorter than {shortest_s:.1} s: left out");
    }
    let (sheet, out) = (args.out.join(SHEET), quoted(&args.out.display().to_string()));
    let sheet = sheet.display();
    text + &format!("\nlook at  {sheet}\nnext     isoflop run own-data --set data.path={out}\n")
}

fn hours(frames: usize, fps: f64) -> String {
    let minutes = frames as f64 / fps / 60.0;
    if minutes < 120.0 { format!("{minutes:.1} min") } else { format!("{:.1} h", minutes / 60.0) }
}
