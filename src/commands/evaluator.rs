//! `isoflop evaluator`: trains the evaluator of motions and shows its gates.

use super::args::FolderArgs;
use super::context::{OpenSweep, read_sweep};
use super::prelude::*;
use super::run::{RunArgs, run_only};
use clap::Subcommand;
use isoflop::evaluator::{EvaluatorReport, table};
use isoflop::jobs::JobKind;
use isoflop::plan::EvaluatorJob;

#[derive(Args)]
pub struct EvaluatorArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Train only the evaluator of a sweep, and measure its gates
    Train(RunArgs),
    /// Show the gates of the evaluators of sweeps
    Gates(FolderArgs),
}

pub fn evaluator(args: &EvaluatorArgs, output: &Output) -> Result<Exit> {
    match &args.what {
        What::Train(args) => train(args, output),
        What::Gates(args) => gates(args, output),
    }
}

/// Trains the evaluator unless it is trained already, then shows its gates.
fn train(args: &RunArgs, output: &Output) -> Result<Exit> {
    if read_sweep(&args.sweep)?.0.evaluator.is_none() {
        bail!(
            "the sweep names no evaluator; add `evaluator: {{}}` to it, or --set 'evaluator={{}}'"
        );
    }
    run_only(args, JobKind::Evaluator, output, |OpenSweep { plan, folder, .. }| {
        let id = plan.evaluator.as_ref().map(EvaluatorJob::id);
        if let Some(report) = id.map(|id| folder.gates(&id)).transpose()?.flatten() {
            show(&[report], output)?;
        }
        Ok(())
    })
}

fn gates(args: &FolderArgs, output: &Output) -> Result<Exit> {
    let reports = args.read(|folder| Ok(folder.all_gates(|line| output.warn(&line))?))?;
    if reports.is_empty() {
        bail!("no evaluator is trained yet; `isoflop evaluator train` trains that of a sweep");
    }
    show(&reports, output)
}

fn show(reports: &[EvaluatorReport], output: &Output) -> Result<Exit> {
    let texts: Vec<String> = reports.iter().map(table).collect();
    output.result(&json!({ "evaluators": reports }), &texts.join("\n\n"))
}
