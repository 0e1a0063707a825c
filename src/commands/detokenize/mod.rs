//! `isoflop detokenize`: codes back into motions, and how far they are from the originals.

mod args;
mod made;
mod text;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use isoflop::codes::ClipCodes;
use isoflop::data::read_motion;
use isoflop::figures::motion::{CaptionedMotion, write_motion};
use isoflop::jobs::TrainedTokenizer;
use isoflop::motion::{N_FEATURES, mpjpe_mm, recover_joints};
use rayon::prelude::*;
use serde_json::json;

pub use args::DetokenizeArgs;
use made::Made;

use super::exit::Exit;
use super::output::Output;
use super::tokenize::motion_name;

pub fn detokenize(args: &DetokenizeArgs, output: &Output) -> Result<Exit> {
    let tokenizer = args.tokenizer.open()?;
    if args.detokenizer_guidance > 0.0 && !tokenizer.has_language() {
        bail!("the tokenizer has no language that --detokenizer-guidance could follow");
    }
    let names = names(args)?;
    let decode = |path: &PathBuf| {
        decoded(args, &tokenizer, path).with_context(|| format!("detokenizing {}", path.display()))
    };
    // All are read and decoded before the first is written.
    let decoded: Vec<Decoded> = args.files.par_iter().map(decode).collect::<Result<_>>()?;
    let written = names.iter().zip(&decoded).map(|(name, decoded)| write(args, name, decoded));
    let made: Vec<Made> = written.collect::<Result<_>>()?;
    let mean = mean_mpjpe(&made);
    let document = json!({
        "tokenizer": tokenizer.id, "folder": args.out, "motions": made, "mpjpe_mm": mean,
    });
    output.result(&document, &text::text(&tokenizer, &made, mean, args))
}

/// The name of each motion, of which the folder holds no file yet, or none that is to stay.
fn names(args: &DetokenizeArgs) -> Result<Vec<String>> {
    let names: Vec<String> = args.files.iter().map(|path| motion_name(path)).collect();
    for (i, name) in names.iter().enumerate() {
        if names[..i].contains(name) {
            bail!("two of the files would both become {name}.npy; detokenize them apart");
        }
        let endings = ["joints.npy", "features.npy", "bvh", "svg"];
        let files = endings.map(|ending| args.out.join(format!("{name}.{ending}")));
        if let Some(file) = files.iter().find(|file| file.exists() && !args.overwrite) {
            bail!("{} is there already; give another --out, or --overwrite", file.display());
        }
    }
    Ok(names)
}

/// A clip, its features and its distance from the original.
struct Decoded {
    clip: ClipCodes,
    /// `[frames, 263]` row-major.
    features: Vec<f32>,
    mpjpe_mm: Option<f64>,
}

fn decoded(args: &DetokenizeArgs, tokenizer: &TrainedTokenizer, path: &Path) -> Result<Decoded> {
    let clip = ClipCodes::read(path)?;
    if clip.tokenizer_id != tokenizer.id {
        let (own, given) = (&clip.tokenizer_id, &tokenizer.id);
        bail!("its codes are those of tokenizer {own}, and the one given is {given}");
    }
    let caption = tokenizer.embed(clip.caption.as_deref())?;
    let guidance = args.detokenizer_guidance;
    let features =
        tokenizer.tokenizer.decode(&clip.codes, clip.frames, caption.as_deref(), guidance)?;
    let truth = truth(args, path, &clip)?;
    let mpjpe_mm = truth.map(|truth| distance(&truth, &features, clip.fps)).transpose()?;
    Ok(Decoded { clip, features, mpjpe_mm })
}

/// The original's file, where there is one.
fn truth(args: &DetokenizeArgs, path: &Path, clip: &ClipCodes) -> Result<Option<PathBuf>> {
    let own = || path.parent().unwrap_or(Path::new("")).to_path_buf();
    let place = args.truth.clone().unwrap_or_else(own);
    if args.truth.is_some() && !place.is_dir() {
        return match args.files.len() {
            1 => Ok(Some(place)),
            n => bail!("--truth {} is no folder, and there are {n} files", place.display()),
        };
    }
    let file = place.join(&clip.motion);
    match (file.is_file(), args.truth.is_some()) {
        (true, _) => Ok(Some(file)),
        (false, true) => bail!("{} holds no {}", place.display(), clip.motion),
        (false, false) => Ok(None),
    }
}

/// MPJPE of the frames that were made.
fn distance(truth: &Path, made: &[f32], fps: f64) -> Result<f64> {
    let features = read_motion(truth, fps)?;
    let n_frames = |values: &[f32]| values.len() / N_FEATURES;
    let (found, wanted) = (n_frames(&features), n_frames(made));
    if found < wanted {
        bail!("{} has {found} frames, and the codes stand for {wanted}", truth.display());
    }
    Ok(mpjpe_mm(&recover_joints(&features[..made.len()]), &recover_joints(made)))
}

fn write(args: &DetokenizeArgs, name: &str, decoded: &Decoded) -> Result<Made> {
    let Decoded { clip, features, mpjpe_mm } = decoded;
    let caption = clip.caption.as_deref().unwrap_or(name);
    let motion = CaptionedMotion { features, fps: clip.fps as f32, caption };
    let written =
        write_motion(&args.out, name, &motion).with_context(|| format!("writing motion {name}"))?;
    Ok(Made {
        motion: name.to_string(),
        frames: clip.frames,
        mpjpe_mm: *mpjpe_mm,
        bvh_largest_mm: written.deviation.largest_mm,
        bvh_mean_mm: written.deviation.mean_mm,
    })
}

/// Over the frames of all motions whose original was found.
fn mean_mpjpe(made: &[Made]) -> Option<f64> {
    let known = made.iter().filter_map(|made| Some((made.mpjpe_mm?, made.frames as f64)));
    let (sum, frames) =
        known.fold((0.0, 0.0), |(sum, n), (mm, frames)| (sum + mm * frames, n + frames));
    (frames > 0.0).then_some(sum / frames)
}
