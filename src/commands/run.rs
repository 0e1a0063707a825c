//! `isoflop run`: what is missing of a sweep, then laws, figures and predictions.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use isoflop::record::{Failure, JobKind, ResultsFolder};
use isoflop::schedule::presence::Held;
use isoflop::schedule::{
    Display, Executor, Job, JobEnd, JobReport, LocalPool, LocalProcesses, Spent, Timeline, memory,
    missing_jobs, stop_on_signals,
};

use super::analyse;
use super::args::{EngineName, RunArgs};
use super::command_line::CommandLine;
use super::context::{OpenSweep, device, open_sweep};
use super::exit::Exit;
use super::failures::Summary;
use super::output::Output;
use super::prepare::prepare;
use super::slurm;

pub fn run(args: &RunArgs, output: &Output) -> Result<Exit> {
    match args.engine {
        EngineName::Slurm if args.fail_fast => {
            bail!("--fail-fast is for this machine; on Slurm the other runs go on")
        }
        EngineName::Slurm => slurm::run(args, output),
        EngineName::Local if args.dry_run || args.check || args.profile.is_some() => {
            bail!(
                "--dry-run, --check and --profile want --engine slurm; see `isoflop plan` for this \
                 machine"
            )
        }
        EngineName::Local => run_here(args, output),
    }
}

/// Reads, plans and warns.
pub fn open(args: &RunArgs, output: &Output) -> Result<OpenSweep> {
    let open = open_sweep(&args.sweep)?;
    open.plan.warnings().iter().for_each(|line| output.warn(line));
    if open.plan.runs.is_empty() {
        bail!("every cell of the grid is dropped; `isoflop plan` gives the reasons");
    }
    Ok(open)
}

fn run_here(args: &RunArgs, output: &Output) -> Result<Exit> {
    device(args.sweep.device)?;
    let open = open(args, output)?;
    let held = hold(&open.folder, output)?;
    prepare(&open, args, output)?;
    CommandLine::of(args)?.write(&open.folder)?;
    let jobs = missing_jobs(&open.plan, &open.folder);
    let reports = train(args, &open, &held, jobs, output)?;
    let summary = Summary::new(args, &open.plan, &open.folder, &reports)?;
    if let Some(halt) = halt(&reports) {
        summary.failures(output);
        output.warn(&halted(halt, &summary.command));
        return Ok(Exit::SomeRunsFailed);
    }
    if interrupted(&reports, args.fail_fast) {
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

/// One `run` at a time in a folder.
pub fn hold(folder: &ResultsFolder, output: &Output) -> Result<Held> {
    let root = folder.root().display();
    let waiting =
        || output.note(&format!("another isoflop is at work in {root}; waiting for it to end"));
    Held::take(folder, waiting).with_context(|| format!("cannot make the folder {root} mine"))
}

fn train(
    args: &RunArgs,
    open: &OpenSweep,
    held: &Held,
    jobs: Vec<Job>,
    output: &Output,
) -> Result<Vec<JobReport>> {
    let (done, all) = (open.plan.runs.len(), open.plan.runs.len());
    let done = done - jobs.iter().filter(|job| job.id.kind == JobKind::Run).count();
    if jobs.is_empty() {
        output.note(&format!("{all} of {all} runs have ended already; nothing to train"));
        return Ok(Vec::new());
    }
    let slots = args.sweep.slots().min(jobs.len());
    output.note(&format!(
        "{} jobs to do, {done} of {all} runs have ended already; {slots} side by side",
        jobs.len()
    ));
    let runner = LocalProcesses {
        folder: open.folder.clone(),
        device: args.sweep.device.name().to_string(),
        program: own_program()?,
        hang: open.sweep.train.hang(),
    };
    let stop = stop_on_signals()?;
    held.watch(&stop);
    let display = Display::new(&jobs, slots, output.quiet);
    let timeline = Timeline::open(&open.folder)?;
    let pool = LocalPool {
        runner: &runner,
        slots,
        stop: &stop,
        fail_fast: args.fail_fast,
        display: &display,
        memory_bytes: memory_bytes(args, &jobs, output),
        timeline: Some(&timeline),
    };
    let reports = pool.execute(jobs);
    display.clear();
    output.note(&time_spent(&timeline.spent(), slots));
    Ok(reports)
}

/// Where the time of the slots went; programs of other people do not tell of their steps.
fn time_spent(spent: &Spent, slots: usize) -> String {
    let minutes = spent.span_s / 60.0;
    match 100.0 * spent.training_share(slots) {
        0.0 => format!("{minutes:.1} min"),
        share => format!("{minutes:.1} min, {share:.0} % of the core-seconds in training steps"),
    }
}

/// Memory for all jobs together; a job that wants more than that is named.
fn memory_bytes(args: &RunArgs, jobs: &[Job], output: &Output) -> Option<u64> {
    let bytes = args.memory.or_else(memory::available)?;
    let largest = jobs.iter().max_by_key(|job| job.peak_bytes)?;
    if largest.peak_bytes > bytes {
        output.warn(&format!(
            "{} wants {:.1} GB of memory at its peak, and there are {:.1} GB: it runs alone, and \
             may be killed",
            largest.label,
            largest.peak_bytes as f64 / 1e9,
            bytes as f64 / 1e9
        ));
    }
    Some(bytes)
}

/// This program as it was started: by its image in memory where the system shows it, so that workers
/// are of the same build even when the file has been replaced or removed since.
fn own_program() -> Result<PathBuf> {
    let image = PathBuf::from(format!("/proc/{}/exe", std::process::id()));
    if image.exists() {
        return Ok(image);
    }
    std::env::current_exe().context("finding this program")
}
