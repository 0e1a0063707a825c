//! `isoflop generate`: makes motions from captions with a trained run, and writes files.

mod args;
mod edit;
mod times;

pub use args::GenerateArgs;

use super::feet::{CleanedFeet, feet_line};
use super::prelude::*;
use args::Seconds;
use edit::Source;
use isoflop::figures::motion::{CaptionedMotion, write_motion, write_sheet};
use isoflop::generator::Prompt;
use isoflop::jobs::{MadeMotion, TrainedRun};
use isoflop::motion::recover_joints;
use isoflop::scores::{Physics, physics};
use std::time::Instant;

/// Motions per batch.
const BATCH: usize = 64;

/// Motions on the contact sheet, at most.
const ON_SHEET: usize = 24;

/// A motion to generate.
struct Order {
    caption: String,
    /// The caption's vectors.
    text: Vec<f32>,
    n_frames: Option<usize>,
    /// Its number: names its files and selects its stream of random numbers.
    index: usize,
}

pub fn generate(args: &GenerateArgs, output: &Output) -> Result<Exit> {
    if args.seconds == Some(Seconds::Auto) && (args.times || args.edit.is_some()) {
        bail!("--seconds auto is for whole motions of captions; here give a number of seconds");
    }
    let run = TrainedRun::open(&args.run, &args.device.open()?)?;
    if args.times {
        return times::times(args, &run, output);
    }
    let has_language = run.tokenizer.spec().architecture.language().is_some();
    if args.detokenizer_guidance.is_some_and(|strength| strength > 0.0) && !has_language {
        bail!("the run's tokenizer has no language that --detokenizer-guidance could follow");
    }
    let out = folder(args, &run)?;
    let source =
        args.edit.as_ref().map(|path| Source::read(path, args, &run, output)).transpose()?;
    let orders = orders(args, &run, source.as_ref())?;
    warn_of_words(&args.all_captions()?, &run, output);
    let started = Instant::now();
    let made = make(args, &run, &orders, source.as_ref())?;
    let made_s = started.elapsed().as_secs_f64();
    let motions = write(args, &run, &orders, &made, &out)?;
    let document = json!({ "run": run.run_id, "folder": out, "motions": motions });
    output.result(&document, &text(&run, &motions, &out, made_s))
}

/// The folder for motions; an error if it has motions already, unless they may be overwritten.
fn folder(args: &GenerateArgs, run: &TrainedRun) -> Result<PathBuf> {
    let own = || run.folder.file("samples").join(&run.run_id);
    let out = args.out.clone().unwrap_or_else(own);
    if out.join(MOTIONS).exists() && !args.overwrite {
        bail!("{} holds motions already; give another --out, or --overwrite", out.display());
    }
    Ok(out)
}

const MOTIONS: &str = "motions.json";

/// Warns of words that training never showed.
fn warn_of_words(captions: &[String], run: &TrainedRun, output: &Output) {
    let words: Vec<String> =
        run.unseen_words(captions).iter().map(|word| format!("\"{word}\"")).collect();
    match words.split_last() {
        None => {}
        Some((word, [])) => output.warn(&format!("{word} stands in no training caption")),
        Some((last, others)) => {
            let others = others.join(", ");
            output.warn(&format!("{others} and {last} stand in no training caption"));
        }
    }
}

/// The requested motions: some per caption.
fn orders(args: &GenerateArgs, run: &TrainedRun, source: Option<&Source>) -> Result<Vec<Order>> {
    let asked = source.map(Source::n_frames).or(args.n_frames(run.spec.fps));
    let draws = asked.is_none() && (run.wants_length() || args.seconds == Some(Seconds::Auto));
    let estimator = draws.then(|| run.length_estimator()).transpose();
    let estimator = estimator.context("estimating lengths; --seconds gives one")?;
    let mut orders = Vec::new();
    for caption in args.all_captions()? {
        let text = run.embed(&caption)?;
        for _ in 0..args.samples {
            let index = orders.len();
            let drawn =
                estimator.as_ref().map(|own| run.draw_length(own, &text, args.seed, index as u64));
            let n_frames = asked.or(drawn);
            let (caption, text) = (caption.clone(), text.clone());
            orders.push(Order { caption, text, n_frames, index });
        }
    }
    Ok(orders)
}

/// A motion with its features as they are written, and what was moved in them.
type Finished = (MadeMotion, Option<CleanedFeet>);

/// Generates codes, then features, one batch at a time; of an edit, the part joined to the rest.
fn make(
    args: &GenerateArgs,
    run: &TrainedRun,
    orders: &[Order],
    source: Option<&Source>,
) -> Result<Vec<Finished>> {
    let (sampling, detokenizer_guidance) = args.sampling(run)?;
    let mut made = Vec::with_capacity(orders.len());
    for batch in orders.chunks(BATCH) {
        let prompts = batch.iter().map(|order| Prompt {
            text: &order.text,
            n_frames: order.n_frames,
            seed: args.seed,
            index: order.index as u64,
            edit: source.map(Source::edit),
        });
        let prompts: Vec<Prompt> = prompts.collect();
        let motions = run.motions(&prompts, &sampling, detokenizer_guidance)?;
        made.extend(motions.into_iter().map(|MadeMotion { sampled, features }| {
            let joined = source.map(|source| source.joined(&features, run.spec.fps));
            let mut features = joined.unwrap_or(features);
            let feet = args.clean_feet.then(|| CleanedFeet::clean(&mut features, run.spec.fps));
            (MadeMotion { sampled, features }, feet)
        }));
    }
    Ok(made)
}

/// Writes the files of every motion, the contact sheet and last the list.
fn write(
    args: &GenerateArgs,
    run: &TrainedRun,
    orders: &[Order],
    made: &[Finished],
    out: &Path,
) -> Result<Vec<Motion>> {
    let fps = run.spec.fps;
    let captioned = orders.iter().zip(made).map(|(Order { caption, .. }, (made, _))| {
        CaptionedMotion { features: &made.features, fps: fps as f32, caption }
    });
    let all: Vec<CaptionedMotion> = captioned.collect();
    let mut motions = Vec::with_capacity(all.len());
    for (index, (motion, (MadeMotion { sampled, .. }, feet))) in all.iter().zip(made).enumerate() {
        let written = write_motion(out, &index.to_string(), motion);
        let written = written.with_context(|| format!("writing motion {index}"))?;
        motions.push(Motion {
            caption: motion.caption.to_string(),
            seed: args.seed,
            length: sampled.n_frames,
            fps,
            seconds: sampled.n_frames as f64 / fps,
            codes: sampled.codes.clone(),
            ended: sampled.ended,
            bvh_largest_mm: written.deviation.largest_mm,
            bvh_mean_mm: written.deviation.mean_mm,
            physics: physics(&recover_joints(motion.features), fps).ok(),
            feet: *feet,
            run: run.run_id.clone(),
        });
    }
    write_sheet(&out.join("sheet.png"), &all[..all.len().min(ON_SHEET)])?;
    atomic::write_json(&out.join(MOTIONS), &motions)?;
    Ok(motions)
}

// The result as text.

/// Characters of a caption that are shown.
const CAPTION: usize = 56;

/// The run, the motions with the seconds to make them (without files), and their folder.
fn text(run: &TrainedRun, motions: &[Motion], out: &Path, made_s: f64) -> String {
    let n = motions.len();
    let row = |(index, motion): (usize, &Motion)| {
        let cut = if motion.ended { "" } else { "  cut" };
        let caption = clip(&motion.caption, CAPTION) + cut;
        [format!("  {index}"), format!("{:.1} s", motion.seconds), caption]
    };
    let mut text = format!(
        "{} in {:.2} s, {:.0} a minute, by\n{} ({})\n\n{}",
        many(n, "motion"),
        made_s,
        60.0 * n as f64 / made_s,
        run.spec.label(),
        run.run_id,
        listed(["", "", "<"], motions.iter().enumerate().map(row))
    );
    if motions.iter().any(|motion| !motion.ended) {
        text += "  cut: the model's context had no room for more\n";
    }
    let largest = motions.iter().map(|m| m.bvh_largest_mm).fold(0.0, f64::max);
    let out = out.display();
    let _ = write!(
        text,
        "\nfiles     {out}/<n>.svg .bvh .glb .joints.npy .features.npy\n          {out}/sheet.png, motions.json\n\
         BVH       bones have one length; joints are off by {largest:.0} mm at most\n"
    );
    let feet: Vec<CleanedFeet> = motions.iter().filter_map(|motion| motion.feet).collect();
    text + &bodies(motions) + &feet_line(&feet)
}

/// Mean statistics of motions of four frames and more that need no evaluator.
fn bodies(motions: &[Motion]) -> String {
    let seen: Vec<&Physics> = motions.iter().filter_map(|m| m.physics.as_ref()).collect();
    if seen.is_empty() {
        return String::new();
    }
    let n = seen.len() as f64;
    let mean = |of: fn(&Physics) -> f64| seen.iter().map(|own| of(own)).sum::<f64>() / n;
    format!(
        "bodies    a foot slides in {:.0} % of the steps from frame to frame\n          \
             bones vary by {:.0} mm, the lowest joint is {:.0} mm under the floor\n",
        100.0 * mean(|physics| physics.foot_skate),
        mean(|physics| physics.bone_spread_mm),
        mean(|physics| physics.penetration_mm),
    )
}

// [`Motion`]: an entry of `motions.json`.

/// An element of `motions.json`.
#[derive(Serialize)]
struct Motion {
    pub caption: String,
    pub seed: u64,
    /// Frames.
    pub length: usize,
    /// Frames per second.
    pub fps: f64,
    pub seconds: f64,
    /// Scale after scale.
    pub codes: Vec<u32>,
    /// Whether the model ended the motion, or had a length to meet.
    pub ended: bool,
    /// Distance of the BVH's rigid body from the joints, at most and on average.
    pub bvh_largest_mm: f64,
    pub bvh_mean_mm: f64,
    /// Statistics that need no evaluator; `None` below four frames.
    pub physics: Option<Physics>,
    /// What `--clean-feet` moved; absent without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feet: Option<CleanedFeet>,
    pub run: String,
}
