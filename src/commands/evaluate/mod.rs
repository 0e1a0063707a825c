//! `isoflop evaluate`: motions scored by a trained evaluator, those of a run or those in files.

mod args;
mod files;
mod motions;
mod text;

use std::path::Path;

use anyhow::Result;
use isoflop::evaluator::OneScore;
use isoflop::jobs::{RunScores, Scoring, TrainedRun, TrustedEvaluator};

pub use args::EvaluateArgs;
use files::FileScores;
use motions::named_motions;

use super::exit::Exit;
use super::output::Output;

pub fn evaluate(args: &EvaluateArgs, output: &Output) -> Result<Exit> {
    match &args.run {
        Some(run) => of_run(args, run, output),
        None => of_files(args, output),
    }
}

/// Makes motions of every test clip's caption, as often as asked for, and scores them.
fn of_run(args: &EvaluateArgs, run: &Path, output: &Output) -> Result<Exit> {
    let device = args.device.open()?;
    let run = TrainedRun::open(run, &device)?;
    let evaluator = args.evaluator.as_deref().unwrap_or(run.folder.root());
    let trusted = TrustedEvaluator::open(evaluator, &device)?;
    let (truth, spec) = (trusted.truth()?, args.spec());
    let scoring = Scoring::new(&run, &trusted.evaluator, &truth, &spec)?;
    let mut repeats: Vec<OneScore> = Vec::new();
    for index in 0..spec.repeats {
        repeats.push(scoring.repeat(index)?);
        let OneScore { fid, precision: [first, ..], .. } = repeats[index];
        let (done, all) = (index + 1, spec.repeats);
        output.note(&format!("[{done}/{all}] FID {fid:.4}, R@1 {first:.3}"));
    }
    let scores: RunScores = scoring.finish(&repeats, &trusted.id)?;
    output.result(&serde_json::to_value(&scores)?, &text::of_run(&run.spec.label(), &scores))
}

fn of_files(args: &EvaluateArgs, output: &Output) -> Result<Exit> {
    let place = args.evaluator.as_deref().expect("asked for beside files");
    let trusted = TrustedEvaluator::open(place, &args.device.open()?)?;
    let motions = named_motions(args, trusted.evaluator.fps())?;
    let scores = FileScores::of(&motions, &trusted, args)?;
    output.result(&serde_json::to_value(&scores)?, &text::of_files(&scores))
}
