//! `isoflop tokenize`: motions into codes, a file each.

mod args;
mod caption;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use isoflop::codes::{ClipCodes, ClipScale};
use isoflop::data::{FAR, read_motion};
use isoflop::jobs::TrainedTokenizer;
use isoflop::motion::N_FEATURES;
use rayon::prelude::*;
use serde_json::json;

pub use args::{TokenizeArgs, motion_name};
use caption::captions;
pub use caption::{caption_beside, captions_of_lines, lines_of};

use super::exit::Exit;
use super::output::Output;
use super::screen::{many, more, table};

pub fn tokenize(args: &TokenizeArgs, output: &Output) -> Result<Exit> {
    let tokenizer = args.tokenizer.open()?;
    let captions = captions(args)?;
    let places = places(args)?;
    let motions = args.files.par_iter().zip(captions);
    let encode = |(path, caption): (&PathBuf, Option<String>)| {
        encoded(&tokenizer, path, caption).with_context(|| format!("tokenizing {}", path.display()))
    };
    // All are read and encoded before the first is written.
    let encoded: Vec<(ClipCodes, f64)> = motions.map(encode).collect::<Result<_>>()?;
    encoded.iter().filter(|(_, far)| *far > FAR).for_each(|clip| output.warn(&strange(clip)));
    let clips: Vec<ClipCodes> = encoded.into_iter().map(|(clip, _)| clip).collect();
    places.iter().zip(&clips).try_for_each(|(place, clip)| clip.write(place))?;
    let document = json!({ "tokenizer": tokenizer.id, "files": places, "motions": clips });
    output.result(&document, &text(&tokenizer, &clips, args))
}

/// The file of each motion's codes.
fn places(args: &TokenizeArgs) -> Result<Vec<PathBuf>> {
    let mut taken: HashMap<PathBuf, &Path> = HashMap::new();
    let mut places = Vec::with_capacity(args.files.len());
    for path in &args.files {
        let place = args.out.join(format!("{}.json", motion_name(path)));
        if let Some(other) = taken.insert(place.clone(), path) {
            let [other, path, place] = [other, path, &place].map(Path::display);
            bail!("{other} and {path} would both become {place}; tokenize them apart");
        }
        if place.exists() && !args.overwrite {
            bail!("{} is there already; give another --out, or --overwrite", place.display());
        }
        places.push(place);
    }
    Ok(places)
}

fn strange((clip, far): &(ClipCodes, f64)) -> String {
    format!(
        "{} is like nothing that the tokenizer was trained on: its features are {far:.1} deviations from \
         their mean; joints are in metres with y up, features are not normalised",
        clip.motion
    )
}

/// The codes of a motion, and how strange it is; frames after its last whole latent are left out.
fn encoded(
    tokenizer: &TrainedTokenizer,
    path: &Path,
    caption: Option<String>,
) -> Result<(ClipCodes, f64)> {
    let features = read_motion(path, tokenizer.tokenizer.fps())?;
    let (n_frames, spec) = (features.len() / N_FEATURES, tokenizer.tokenizer.spec());
    let stride = spec.frames_per_latent();
    if n_frames < stride {
        bail!("it has {n_frames} frames, and the tokenizer's latents take {stride} each");
    }
    let embedded = tokenizer.embed(caption.as_deref());
    let embedded = embedded.context("give --caption, --texts, or a .txt beside it")?;
    let codes = tokenizer.tokenizer.encode(&features, embedded.as_deref())?;
    let frames = n_frames / stride * stride;
    let clip = ClipCodes {
        tokenizer_id: tokenizer.id.clone(),
        motion: path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        caption,
        fps: tokenizer.tokenizer.fps(),
        frames,
        scales: ClipScale::of(&spec.grid(), frames),
        codes,
    };
    Ok((clip, tokenizer.tokenizer.stats().deviations(&features)))
}

/// Motions that are listed, at most.
const LISTED: usize = 12;

/// What a person reads: a screen.
fn text(tokenizer: &TrainedTokenizer, clips: &[ClipCodes], args: &TokenizeArgs) -> String {
    let spec = tokenizer.tokenizer.spec();
    let (n, kind, v) = (clips.len(), spec.quantizer.name(), spec.n_vocab());
    let row = |clip: &ClipCodes| {
        let seconds = format!("{:.1} s", clip.frames as f64 / clip.fps);
        let (frames, codes) = (format!("  {} frames", clip.frames), clip.codes.len());
        [frames, seconds, format!("{codes} codes"), clip.motion.clone()]
    };
    let rows = table(["", "", "", "<"], clips.iter().take(LISTED).map(row));
    let heading = format!("{} by tokenizer {} ({kind}, V {v})", many(n, "motion"), tokenizer.id);
    let text = format!("{heading}\n\n{rows}{}", more(n, LISTED, ""));
    text + &format!("\nfiles     {}/<motion>.json\n", args.out.display())
}
