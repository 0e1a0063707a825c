//! `isoflop run`: what is missing of a sweep, then laws, figures and predictions.

mod args;
mod prepare;
mod rounds;
mod summary;

use std::ops::ControlFlow;

use anyhow::{Context, Result, bail};
use isoflop::engine::{
    Brought, Engine, JobEnd, JobReport, Preview, Previewed, Session, SweepRequest,
};
use isoflop::failure::Failure;
use isoflop::jobs::presence::Held;
use isoflop::jobs::{Job, JobKind, ResultsFolder, missing_jobs};
use prepare::prepare;
use summary::Summary;

use crate::commands::analyse;
use crate::commands::command_line::CommandLine;
use crate::commands::context::{OpenSweep, open_sweep};
use crate::commands::exit::Exit;
use crate::commands::output::Output;

pub use args::RunArgs;

pub fn run(args: &RunArgs, output: &Output) -> Result<Exit> {
    if let Some(most) = args.rounds {
        return rounds::run_in_rounds(args, most.into(), output);
    }
    carry_out(
        args,
        output,
        |_| true,
        |open, summary| {
            analyse::finish(&open.folder, output)?;
            Ok(summary.tell(output))
        },
    )
}

/// Does all that is missing and its table, then has `then` tell of it.
pub fn run_then(
    args: &RunArgs,
    output: &Output,
    then: impl FnOnce(&ResultsFolder) -> Result<()>,
) -> Result<Exit> {
    carry_out(
        args,
        output,
        |_| true,
        |open, summary| {
            analyse::tabulate(&open.folder, output)?;
            let exit = summary.tell(output);
            then(&open.folder)?;
            Ok(exit)
        },
    )
}

/// Does only the jobs of a kind that needs no other; `then` tells of them.
pub fn run_only(
    args: &RunArgs,
    kind: JobKind,
    output: &Output,
    then: impl FnOnce(&ResultsFolder) -> Result<()>,
) -> Result<Exit> {
    if args.engine.hands_over() {
        bail!("--engine {} does whole sweeps: use `isoflop run`", args.engine.name());
    }
    carry_out(
        args,
        output,
        |job| job.id.kind == kind,
        |open, summary| {
            summary.failures(output);
            then(&open.folder)?;
            let ended_well = summary.reports.iter().all(|report| report.end == JobEnd::Done);
            Ok(if ended_well { Exit::Done } else { Exit::SomeRunsFailed })
        },
    )
}

/// Brings the missing jobs that are wanted to their end, then has `then` tell of them.
fn carry_out(
    args: &RunArgs,
    output: &Output,
    wanted: impl Fn(&Job) -> bool,
    then: impl FnOnce(&OpenSweep, &Summary) -> Result<Exit>,
) -> Result<Exit> {
    args.check_engine()?;
    let open = open(args, output)?;
    match bring(args, &open, wanted, output)? {
        ControlFlow::Continue(reports) => {
            then(&open, &Summary::new(args, &open.plan, &open.folder, &reports)?)
        }
        ControlFlow::Break(exit) => Ok(exit),
    }
}

/// Brings the missing jobs that are wanted to their end. Where that is all there is to do, it has told
/// of them, and breaks off with how to exit.
fn bring(
    args: &RunArgs,
    open: &OpenSweep,
    wanted: impl Fn(&Job) -> bool,
    output: &Output,
) -> Result<ControlFlow<Exit, Vec<JobReport>>> {
    let request = request(args, open, output);
    let engine: &dyn Engine = args.engine;
    let mut session = engine.session(&request)?;
    if let Some(preview) = args.preview() {
        return Ok(ControlFlow::Break(show(&mut *session, preview, open, output)?));
    }
    session.begin()?;
    let held = hold(open, output)?;
    prepare(open, args, output)?;
    CommandLine::of(args)?.write(&open.folder)?;
    let jobs = missing_jobs(&open.plan, &open.folder).into_iter().filter(wanted);
    let reports = match session.bring(jobs.collect())? {
        Brought::Ended(reports) => reports,
        Brought::HandedOver { document, text } => {
            output.result(&document, &text)?;
            return Ok(ControlFlow::Break(Exit::Done));
        }
    };
    let summary = Summary::new(args, &open.plan, &open.folder, &reports)?;
    let interrupted = interruption(args, &summary, output);
    drop(held);
    Ok(interrupted.map_or(ControlFlow::Continue(reports), ControlFlow::Break))
}

/// Reads, plans and warns.
fn open(args: &RunArgs, output: &Output) -> Result<OpenSweep> {
    let open = open_sweep(&args.sweep)?;
    open.plan.warnings().iter().for_each(|line| output.warn(line));
    if open.plan.runs.is_empty() {
        bail!("every cell of the grid is dropped; `isoflop plan` gives the reasons");
    }
    Ok(open)
}

fn request<'a>(args: &'a RunArgs, open: &'a OpenSweep, output: &'a Output) -> SweepRequest<'a> {
    SweepRequest {
        sweep: &open.sweep,
        plan: &open.plan,
        folder: &open.folder,
        device: args.sweep.device,
        slots: args.sweep.slots(),
        memory_bytes: args.memory,
        fail_fast: args.fail_fast,
        profile: args.profile.as_deref(),
        tell: output,
    }
}

fn show(
    session: &mut dyn Session,
    preview: Preview,
    open: &OpenSweep,
    output: &Output,
) -> Result<Exit> {
    let jobs = missing_jobs(&open.plan, &open.folder);
    let Previewed { document, text, taken } = session.preview(preview, jobs)?;
    output.result(&document, &text)?;
    Ok(if taken { Exit::Done } else { Exit::Usage })
}

/// One `run` at a time in a folder.
fn hold(open: &OpenSweep, output: &Output) -> Result<Held> {
    let root = open.folder.root().display();
    let waiting =
        || output.note(&format!("another isoflop is at work in {root}; waiting for it to end"));
    Held::take(&open.folder, waiting).with_context(|| format!("cannot make the folder {root} mine"))
}

/// Tells why the jobs ended too early, if they did.
fn interruption(args: &RunArgs, summary: &Summary, output: &Output) -> Option<Exit> {
    if let Some(halt) = halt(summary.reports) {
        summary.failures(output);
        output.warn(&halted(halt, &summary.command));
        return Some(Exit::SomeRunsFailed);
    }
    if interrupted(summary.reports, args.fail_fast) {
        summary.failures(output);
        output.note("interrupted; the same command goes on from here");
        return Some(Exit::Interrupted);
    }
    None
}

/// What nothing could go on with.
fn halt(reports: &[JobReport]) -> Option<&Failure> {
    reports.iter().find_map(|report| match &report.end {
        JobEnd::Halted(failure) => Some(failure),
        _ => None,
    })
}

fn halted(failure: &Failure, command: &CommandLine) -> String {
    let Failure { kind, reason, .. } = failure;
    let advice = kind.advice().unwrap_or("mend that");
    format!(
        "stopped [{}]: {reason}. Nothing is half-written, and no run is marked as failed: {advice}, \
         and this goes on: {}",
        kind.word(),
        command.go_on()
    )
}

/// Whether a signal stopped jobs, and not a failure under `--fail-fast`.
fn interrupted(reports: &[JobReport], fail_fast: bool) -> bool {
    let failed = |report: &JobReport| report.end.failure().is_some();
    let stopped = reports.iter().any(|report| report.end == JobEnd::Stopped);
    stopped && !(fail_fast && reports.iter().any(failed))
}
