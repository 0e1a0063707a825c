//! `isoflop detokenize`: codes back into motions, and their distance from the originals.

use super::args::not_negative;
use super::context::TokenizerChoice;
use super::feet::{CleanedFeet, feet_line};
use super::prelude::*;
use super::tokenize::{motion_name, warn_of};
use isoflop::codes::ClipCodes;
use isoflop::data::read_motion;
use isoflop::figures::motion::{CaptionedMotion, write_motion};
use isoflop::jobs::TrainedTokenizer;
use isoflop::motion::{N_FEATURES, mpjpe_mm, recover_joints};
use rayon::prelude::*;

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
    let originals = decoded.iter().filter_map(|decoded| decoded.original.as_ref());
    let originals = originals.map(|own| (own.path.as_path(), own.features.as_slice()));
    warn_of(originals, tokenizer.tokenizer.stats(), output);
    let written = names.iter().zip(&decoded).map(|(name, decoded)| write(args, name, decoded));
    let made: Vec<Made> = written.collect::<Result<_>>()?;
    let mean = mean_mpjpe(&made);
    let document = json!({
        "tokenizer": tokenizer.id, "folder": args.out, "motions": made, "mpjpe_mm": mean,
    });
    output.result(&document, &text(&tokenizer.id, &made, mean, &args.out))
}

/// The name of each motion; an error if the folder has its file already, unless it may be overwritten.
fn names(args: &DetokenizeArgs) -> Result<Vec<String>> {
    let names: Vec<String> = args.files.iter().map(|path| motion_name(path)).collect();
    for (i, name) in names.iter().enumerate() {
        if names[..i].contains(name) {
            bail!("two of the files would both become {name}.npy; detokenize them apart");
        }
        let endings = ["joints.npy", "features.npy", "bvh", "glb", "svg"];
        let files = endings.map(|ending| args.out.join(format!("{name}.{ending}")));
        if let Some(file) = files.iter().find(|file| file.exists() && !args.overwrite) {
            bail!("{} is there already; give another --out, or --overwrite", file.display());
        }
    }
    Ok(names)
}

/// A clip, and the motion that its codes stand for.
struct Decoded {
    clip: ClipCodes,
    /// `[frames, 263]` row-major.
    features: Vec<f32>,
    /// The original, if that was found.
    original: Option<Original>,
    /// What `--clean-feet` moved.
    feet: Option<CleanedFeet>,
}

/// The motion that codes were made of.
struct Original {
    path: PathBuf,
    /// `[T, 263]` row-major, not normalised.
    features: Vec<f32>,
    /// MPJPE of the decoded frames.
    mpjpe_mm: f64,
}

fn decoded(args: &DetokenizeArgs, tokenizer: &TrainedTokenizer, path: &Path) -> Result<Decoded> {
    let clip = ClipCodes::read(path)?;
    if clip.tokenizer_id != tokenizer.id {
        let (own, given) = (&clip.tokenizer_id, &tokenizer.id);
        bail!("its codes are those of tokenizer {own}, and the one given is {given}");
    }
    let caption = tokenizer.embed(clip.caption.as_deref())?;
    let guidance = args.detokenizer_guidance;
    let mut features =
        tokenizer.tokenizer.decode(&clip.codes, clip.frames, caption.as_deref(), guidance)?;
    let feet = args.clean_feet.then(|| CleanedFeet::clean(&mut features, clip.fps));
    let truth = truth(args, path, &clip)?;
    let original = truth.map(|truth| Original::read(truth, &features, clip.fps)).transpose()?;
    Ok(Decoded { clip, features, original, feet })
}

/// The original's file, if there is one.
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

impl Original {
    /// Reads a file, and measures the decoded frames by it.
    fn read(path: PathBuf, made: &[f32], fps: f64) -> Result<Self> {
        let features = read_motion(&path, fps)?;
        let n_frames = |values: &[f32]| values.len() / N_FEATURES;
        let (found, wanted) = (n_frames(&features), n_frames(made));
        if found < wanted {
            bail!("{} has {found} frames, and the codes stand for {wanted}", path.display());
        }
        let mpjpe_mm = mpjpe_mm(&recover_joints(&features[..made.len()]), &recover_joints(made));
        Ok(Self { path, features, mpjpe_mm })
    }
}

fn write(args: &DetokenizeArgs, name: &str, decoded: &Decoded) -> Result<Made> {
    let Decoded { clip, features, original, feet } = decoded;
    let caption = clip.caption.as_deref().unwrap_or(name);
    let motion = CaptionedMotion { features, fps: clip.fps as f32, caption };
    let written =
        write_motion(&args.out, name, &motion).with_context(|| format!("writing motion {name}"))?;
    Ok(Made {
        motion: name.to_string(),
        frames: clip.frames,
        mpjpe_mm: original.as_ref().map(|own| own.mpjpe_mm),
        bvh_largest_mm: written.deviation.largest_mm,
        bvh_mean_mm: written.deviation.mean_mm,
        feet: *feet,
    })
}

/// The mean over the frames of all motions whose original was found.
fn mean_mpjpe(made: &[Made]) -> Option<f64> {
    let known = made.iter().filter_map(|made| Some((made.mpjpe_mm?, made.frames as f64)));
    let (sum, frames) =
        known.fold((0.0, 0.0), |(sum, n), (mm, frames)| (sum + mm * frames, n + frames));
    (frames > 0.0).then_some(sum / frames)
}

// The result as text.

/// The result as text.
fn text(id: &str, made: &[Made], mean: Option<f64>, out: &Path) -> String {
    let heading = many(made.len(), "motion");
    let row = |Made { motion, frames, mpjpe_mm, .. }: &Made| {
        let off = dash(*mpjpe_mm, |mm| format!("{mm:.1}"));
        [format!("  {frames} frames"), format!("{off} mm"), motion.clone()]
    };
    let rows = listed(["", "", "<"], made.iter().map(row));
    let mut text = format!("{heading} by tokenizer {id}\n\n{rows}");
    let mean = mean.map_or_else(
        || "unknown: no original lies beside the codes; name it by --truth".to_string(),
        |mean| format!("{mean:.1} mm from the originals, over their frames"),
    );
    let out = out.display();
    text += &format!("\nMPJPE     {mean}\n");
    text += &format!("files     {out}/<motion>.svg .bvh .glb .joints.npy .features.npy\n");
    let feet: Vec<CleanedFeet> = made.iter().filter_map(|made| made.feet).collect();
    text + &feet_line(&feet)
}

// [`Made`]: the facts of a decoded motion.

/// A decoded motion.
#[derive(Serialize)]
struct Made {
    /// The stem of its files.
    pub motion: String,
    pub frames: usize,
    /// Distance from the original, if it was found.
    pub mpjpe_mm: Option<f64>,
    /// Distance of the BVH's rigid body from the joints, at most and on average.
    pub bvh_largest_mm: f64,
    pub bvh_mean_mm: f64,
    /// What `--clean-feet` moved; absent without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feet: Option<CleanedFeet>,
}

// The arguments of `isoflop detokenize`.

#[derive(Args)]
pub struct DetokenizeArgs {
    /// Codes that `isoflop tokenize` wrote
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<PathBuf>,
    #[command(flatten)]
    pub tokenizer: TokenizerChoice,
    /// The original of a single file, or a folder with originals of the same names; by default the
    /// folder of the codes
    #[arg(long, value_name = "PATH")]
    pub truth: Option<PathBuf>,
    /// Strength of caption guidance, for a tokenizer with language
    #[arg(long, value_name = "S", default_value_t = 0.0, value_parser = not_negative)]
    pub detokenizer_guidance: f64,
    /// Pin feet that slide to one place on the floor in each contact, by inverse kinematics of the legs
    #[arg(long)]
    pub clean_feet: bool,
    /// The folder to write to
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Overwrite motions in the folder
    #[arg(long)]
    pub overwrite: bool,
}
