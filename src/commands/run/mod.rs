//! `isoflop run`: what is missing of a sweep, then laws, figures and predictions.

mod bring;
mod command_line;
mod rounds;
mod summary;

use super::prelude::*;
use crate::commands::analyse;
use crate::commands::context::OpenSweep;
use isoflop::engine::JobEnd;
use isoflop::jobs::{Job, JobKind};
use rounds::run_in_rounds;
use std::ops::ControlFlow;
use summary::Summary;

pub use bring::{bring, hold, open};
pub use command_line::{CommandLine, RunArgs};

pub fn run(args: &RunArgs, output: &Output) -> Result<Exit> {
    if let Some(most) = args.options.rounds {
        return run_in_rounds(args, most.into(), output);
    }
    carry_out(args, None, output, |summary| {
        // Why there is nothing comes before all else.
        let told = (!summary.has_results()).then(|| summary.tell(output));
        analyse::finish(&summary.open.folder, output)?;
        Ok(told.unwrap_or_else(|| summary.tell(output)))
    })
}

/// Does all that is missing and its table, then has `then` tell of it.
pub fn run_then(
    args: &RunArgs,
    output: &Output,
    then: impl FnOnce(&ResultsFolder) -> Result<()>,
) -> Result<Exit> {
    carry_out(args, None, output, |summary| {
        analyse::tabulate(&summary.open.folder, output)?;
        let exit = summary.tell(output);
        then(&summary.open.folder)?;
        Ok(exit)
    })
}

/// Does only the jobs of a kind that needs no other; `then` tells of them.
pub fn run_only(
    args: &RunArgs,
    kind: JobKind,
    output: &Output,
    then: impl FnOnce(&OpenSweep) -> Result<()>,
) -> Result<Exit> {
    if args.engine.hands_over() {
        bail!("--engine {} does whole sweeps: use `isoflop run`", args.engine.name());
    }
    carry_out(args, Some(kind), output, |summary| {
        summary.failures(output);
        then(summary.open)?;
        let ended_well = summary.reports.iter().all(|report| report.end == JobEnd::Done);
        Ok(if ended_well { Exit::Done } else { Exit::SomeRunsFailed })
    })
}

/// Brings the missing jobs, or those of a kind, to their end, then has `then` tell of them.
fn carry_out(
    args: &RunArgs,
    only: Option<JobKind>,
    output: &Output,
    then: impl FnOnce(&Summary) -> Result<Exit>,
) -> Result<Exit> {
    args.check_engine()?;
    let open = open(args, output)?;
    // Held to the end: another command tidies the folder up as soon as it has it.
    let mut held = None;
    let wanted = |job: &Job| only.is_none_or(|kind| job.id.kind == kind);
    match bring(args, &open, &mut held, wanted, output)? {
        ControlFlow::Continue(summary) => then(&summary),
        ControlFlow::Break(exit) => Ok(exit),
    }
}
