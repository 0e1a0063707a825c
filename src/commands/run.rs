//! `isoflop run`: what is missing of a sweep, then laws, figures and predictions.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::Args;
use isoflop::engine::ENGINES;
use isoflop::engine::{Brought, Engine, JobEnd, JobReport, Preview, Previewed, Request, Session};
use isoflop::failure::Failure;
use isoflop::jobs::missing_jobs;
use isoflop::jobs::presence::Held;
use isoflop::units::parse_bytes;

use super::analyse;
use super::args::{SweepArgs, an_engine};
use super::command_line::CommandLine;
use super::context::{OpenSweep, open_sweep};
use super::exit::Exit;
use super::failures::Summary;
use super::output::Output;
use super::prepare::prepare;

#[derive(Args)]
pub struct RunArgs {
    #[command(flatten)]
    pub sweep: SweepArgs,
    /// Who does the jobs
    #[arg(long, value_parser = an_engine(), default_value = ENGINES[0].name())]
    pub engine: &'static dyn Engine,
    /// A file with the keys of the engine's section, laid over those of the sweep
    #[arg(long, value_name = "FILE")]
    pub profile: Option<PathBuf>,
    /// Print what the engine would be given; give and change nothing
    #[arg(long)]
    pub dry_run: bool,
    /// Ask the engine whether it would take the sweep; give and change nothing
    #[arg(long, conflicts_with = "dry_run")]
    pub check: bool,
    /// Stop at the first failure
    #[arg(long)]
    pub fail_fast: bool,
    /// Try again what failed before
    #[arg(long)]
    pub retry_failed: bool,
    /// Try this job again, and what it needs, by the id of its folder; may be given again
    #[arg(long, value_name = "ID")]
    pub retry: Vec<String>,
    /// Memory for all jobs together, as 8GB; by default what is available at the start
    #[arg(long, value_name = "BYTES", value_parser = parse_bytes)]
    pub memory: Option<u64>,
}

impl RunArgs {
    /// What is only to be shown.
    pub fn preview(&self) -> Option<Preview> {
        let dry_run = self.dry_run.then_some(Preview::DryRun);
        dry_run.or_else(|| self.check.then_some(Preview::Check))
    }
}

pub fn run(args: &RunArgs, output: &Output) -> Result<Exit> {
    let open = open(args, output)?;
    let request = request(args, &open, output);
    let engine: &dyn Engine = args.engine;
    let mut session = engine.session(&request)?;
    if let Some(preview) = args.preview() {
        return show(&*session, preview, &open, output);
    }
    session.begin()?;
    let held = hold(&open, output)?;
    prepare(&open, args, output)?;
    CommandLine::of(args)?.write(&open.folder)?;
    let reports = match session.bring(missing_jobs(&open.plan, &open.folder))? {
        Brought::Ended(reports) => reports,
        Brought::HandedOver { document, text } => {
            output.result(&document, &text)?;
            return Ok(Exit::Done);
        }
    };
    let exit = end(args, &open, &reports, output);
    drop(held);
    exit
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

fn request<'a>(args: &'a RunArgs, open: &'a OpenSweep, output: &'a Output) -> Request<'a> {
    Request {
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
    session: &dyn Session,
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

/// Laws, figures and predictions, unless the jobs ended too early.
fn end(args: &RunArgs, open: &OpenSweep, reports: &[JobReport], output: &Output) -> Result<Exit> {
    let summary = Summary::new(args, &open.plan, &open.folder, reports)?;
    if let Some(halt) = halt(reports) {
        summary.failures(output);
        output.warn(&halted(halt, &summary.command));
        return Ok(Exit::SomeRunsFailed);
    }
    if interrupted(reports, args.fail_fast) {
        summary.failures(output);
        output.note("interrupted; the same command goes on from here");
        return Ok(Exit::Interrupted);
    }
    analyse::finish(&open.folder, output)?;
    Ok(summary.tell(output))
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
