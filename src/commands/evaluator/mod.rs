//! `isoflop evaluator`: what motions are scored by, and what it is worth.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::{Args, Subcommand};
use isoflop::evaluator::{EvaluatorReport, table};
use isoflop::jobs::{JobKind, ResultsFolder};
use isoflop::plan::EvaluatorJob;
use serde_json::json;

use super::context::{OpenSweep, read_sweep};
use super::exit::Exit;
use super::output::Output;
use super::run::{RunArgs, run_only};

#[derive(Args)]
pub struct EvaluatorArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Train the evaluator of a sweep and measure its gates, and nothing else of the sweep
    Train(RunArgs),
    /// Show the gates of the evaluators of sweeps
    Gates(GatesArgs),
}

#[derive(Args)]
struct GatesArgs {
    /// Sweeps' folders
    #[arg(required = true)]
    results: Vec<PathBuf>,
}

pub fn evaluator(args: &EvaluatorArgs, output: &Output) -> Result<Exit> {
    match &args.what {
        What::Train(args) => train(args, output),
        What::Gates(args) => gates(args, output),
    }
}

/// Trains the evaluator, unless it is there; then its gates are shown.
fn train(args: &RunArgs, output: &Output) -> Result<Exit> {
    if read_sweep(&args.sweep)?.0.evaluator.is_none() {
        bail!(
            "the sweep names no evaluator; add `evaluator: {{}}` to it, or --set 'evaluator={{}}'"
        );
    }
    run_only(args, JobKind::Evaluator, output, |OpenSweep { plan, folder, .. }| {
        let id = plan.evaluator.as_ref().map(EvaluatorJob::id);
        match id.map(|id| folder.gates(&id)).transpose()?.flatten() {
            Some(report) => show(&[report], output),
            None => Ok(()),
        }
    })
}

fn gates(args: &GatesArgs, output: &Output) -> Result<Exit> {
    let mut reports = Vec::new();
    for folder in args.results.iter().map(ResultsFolder::new) {
        if !folder.root().is_dir() {
            bail!("{} does not exist; give a sweep's folder", folder.root().display());
        }
        reports.extend(folder.all_gates(|line| output.warn(&line))?);
    }
    if reports.is_empty() {
        bail!("no evaluator is trained yet; `isoflop evaluator train` trains that of a sweep");
    }
    show(&reports, output)?;
    Ok(Exit::Done)
}

fn show(reports: &[EvaluatorReport], output: &Output) -> Result<()> {
    let texts: Vec<String> = reports.iter().map(table).collect();
    Ok(output.result(&json!({ "evaluators": reports }), &texts.join("\n\n"))?)
}
