//! `isoflop run`: runs the missing jobs of a sweep, then makes laws, figures and predictions.

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
        // The reason for missing results comes first.
        let told = (!summary.has_results()).then(|| summary.tell(output));
        analyse::finish(&summary.open.folder, output)?;
        Ok(told.unwrap_or_else(|| summary.tell(output)))
    })
}

/// Runs all missing jobs, writes the table, then calls `then` to report.
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

/// Runs only jobs of `kind` (which must have no dependencies), then calls `then` to report.
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

/// Runs the missing jobs, or those of one kind, then calls `then` to report.
fn carry_out(
    args: &RunArgs,
    only: Option<JobKind>,
    output: &Output,
    then: impl FnOnce(&Summary) -> Result<Exit>,
) -> Result<Exit> {
    args.check_engine()?;
    let open = open(args, output)?;
    // Locked to the end: another command cleans the folder as soon as it holds the lock.
    let mut held = None;
    let wanted = |job: &Job| only.is_none_or(|kind| job.id.kind == kind);
    match bring(args, &open, &mut held, wanted, output)? {
        ControlFlow::Continue(summary) => then(&summary),
        ControlFlow::Break(exit) => Ok(exit),
    }
}
