//! `isoflop tokenize`: turns motions into codes, one file each.

use super::context::TokenizerChoice;
use super::prelude::*;
use isoflop::codes::{ClipCodes, ClipScale};
use isoflop::data::{
    Annotation, FeatureStats, Held, Look, Seen, look, parse_annotation, read_motion,
};
use isoflop::files::read_text;
use isoflop::jobs::TrainedTokenizer;
use rayon::prelude::*;
use std::collections::HashMap;

pub fn tokenize(args: &TokenizeArgs, output: &Output) -> Result<Exit> {
    let tokenizer = args.tokenizer.open()?;
    let captions = captions(args)?;
    let places = places(args)?;
    let motions = args.files.par_iter().zip(captions);
    let encode = |(path, caption): (&PathBuf, Option<String>)| {
        encoded(&tokenizer, path, caption).with_context(|| format!("tokenizing {}", path.display()))
    };
    // All are read and encoded before the first is written.
    let encoded: Vec<(ClipCodes, Vec<f32>)> = motions.map(encode).collect::<Result<_>>()?;
    let paths = args.files.iter().map(PathBuf::as_path);
    let features = encoded.iter().map(|(_, features)| features.as_slice());
    warn_of(paths.zip(features), tokenizer.tokenizer.stats(), output);
    let clips: Vec<ClipCodes> = encoded.into_iter().map(|(clip, _)| clip).collect();
    places.iter().zip(&clips).try_for_each(|(place, clip)| clip.write(place))?;
    let document = json!({ "tokenizer": tokenizer.id, "files": places, "motions": clips });
    output.result(&document, &text(&tokenizer, &clips, args))
}

/// Warns of motions of files that may be no motion of a body, or not of the data that `stats` are of.
pub fn warn_of<'a>(
    motions: impl Iterator<Item = (&'a Path, &'a [f32])>,
    stats: &FeatureStats,
    output: &Output,
) {
    let seen =
        motions.map(|(path, rows)| Seen::of(&path.to_string_lossy(), None, Held::Features(rows)));
    let how = Look { stats: Some(stats), ..Look::ALL };
    let found = look(&seen.collect::<Vec<_>>(), how);
    let odd = found.iter().filter(|own| !own.finding.is_minor());
    odd.for_each(|found| output.warn(&found.to_string()));
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

/// The codes of a motion, and its features; frames after its last whole stride are left out.
fn encoded(
    tokenizer: &TrainedTokenizer,
    path: &Path,
    caption: Option<String>,
) -> Result<(ClipCodes, Vec<f32>)> {
    let features = read_motion(path, tokenizer.tokenizer.fps())?;
    let embedded = tokenizer.embed(caption.as_deref());
    let embedded = embedded.context("give --caption, --texts, or a .txt beside it")?;
    let (codes, frames) = tokenizer.encode(&features, embedded.as_deref())?;
    let clip = ClipCodes {
        tokenizer_id: tokenizer.id.clone(),
        motion: path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        caption,
        fps: tokenizer.tokenizer.fps(),
        frames,
        scales: ClipScale::of(&tokenizer.tokenizer.spec().grid(), frames),
        codes,
    };
    Ok((clip, features))
}

/// The result as text.
fn text(tokenizer: &TrainedTokenizer, clips: &[ClipCodes], args: &TokenizeArgs) -> String {
    let spec = tokenizer.tokenizer.spec();
    let (n, kind, v) = (clips.len(), spec.quantizer.name(), spec.n_vocab());
    let row = |clip: &ClipCodes| {
        let seconds = format!("{:.1} s", clip.frames as f64 / clip.fps);
        let (frames, codes) = (format!("  {} frames", clip.frames), clip.codes.len());
        [frames, seconds, format!("{codes} codes"), clip.motion.clone()]
    };
    let rows = listed(["", "", "", "<"], clips.iter().map(row));
    let heading = format!("{} by tokenizer {} ({kind}, V {v})", many(n, "motion"), tokenizer.id);
    format!("{heading}\n\n{rows}\nfiles     {}/<motion>.json\n", args.out.display())
}

// The captions of motions: given, one per line, or in files next to them.

/// The caption of each motion, if it has one.
fn captions(args: &TokenizeArgs) -> Result<Vec<Option<String>>> {
    let n = args.files.len();
    match (&args.caption, &args.texts) {
        (Some(caption), _) if caption.trim().is_empty() => bail!("--caption is empty"),
        (Some(caption), _) => Ok(vec![Some(caption.clone()); n]),
        (None, Some(path)) => captions_of_lines(path, n),
        (None, None) => args.files.iter().map(|path| caption_beside(path)).collect(),
    }
}

/// One caption per line, as many as motions.
pub fn captions_of_lines(path: &Path, n: usize) -> Result<Vec<Option<String>>> {
    let captions: Vec<Option<String>> = lines_of(path)?.into_iter().map(Some).collect();
    if captions.len() != n {
        let found = captions.len();
        bail!("{} has {found} captions for {n} motions; write one a line", path.display());
    }
    Ok(captions)
}

/// The lines of a file that are not blank.
pub fn lines_of(path: &Path) -> Result<Vec<String>> {
    let text = read_text(path).with_context(|| format!("reading {}", path.display()))?;
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    Ok(lines.map(String::from).collect())
}

/// The first caption of the whole clip in the `.txt` next to a motion, plain or in HumanML3D's format.
pub fn caption_beside(motion: &Path) -> Result<Option<String>> {
    let path = motion.with_file_name(format!("{}.txt", motion_name(motion)));
    if !path.is_file() {
        return Ok(None);
    }
    let text = read_text(&path).with_context(|| format!("reading {}", path.display()))?;
    let lines = text.trim_start_matches('\u{feff}').lines().filter(|line| !line.trim().is_empty());
    let read: Result<Vec<Annotation>, _> = lines.map(parse_annotation).collect();
    let read = read.with_context(|| format!("a line of {}", path.display()))?;
    match read.into_iter().find(|annotation| annotation.span_s.is_none()) {
        Some(annotation) => Ok(Some(annotation.caption)),
        None => bail!("{} has no caption of the whole motion", path.display()),
    }
}

// The arguments of `isoflop tokenize`.

#[derive(Args)]
pub struct TokenizeArgs {
    /// Motions: .npy of features, T × 263, or of joints, T × 22 × 3; or .bvh with the 22 joints
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<PathBuf>,
    #[command(flatten)]
    pub tokenizer: TokenizerChoice,
    /// The caption of every motion, for a tokenizer with language; by default from the .txt next to it
    #[arg(long, value_name = "TEXT", conflicts_with = "texts")]
    pub caption: Option<String>,
    /// A file with one caption per line, in the order of the motions
    #[arg(long, value_name = "FILE")]
    pub texts: Option<PathBuf>,
    /// The folder to write to: a .json of codes for each motion
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Overwrite codes in the folder
    #[arg(long)]
    pub overwrite: bool,
}

/// The name of a motion: `walk` of `a/walk.npy`, of `walk.features.npy` and of `walk.joints.npy`.
pub fn motion_name(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let bare = stem.strip_suffix(".features").or(stem.strip_suffix(".joints"));
    bare.unwrap_or(&stem).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn captions_without_an_end_are_refused() {
        let told = format!("{:#}", lines_of(Path::new("/dev/zero")).unwrap_err());
        assert!(told.contains("/dev/zero") && told.contains("no regular file"), "{told}");
    }

    #[test]
    fn the_files_of_a_motion_have_one_name() {
        for path in ["a/walk.npy", "walk.features.npy", "b/walk.joints.npy", "walk.bvh"] {
            assert_eq!(motion_name(Path::new(path)), "walk");
        }
    }
}
