//! `isoflop run`: what is missing of a sweep, then laws, figures and predictions.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use isoflop::record::{JobId, JobKind, ResultsFolder, atomic};
use isoflop::schedule::presence::Held;
use isoflop::schedule::{
    Display, Executor, Job, JobEnd, JobReport, LocalPool, LocalProcesses, inputs, missing_jobs,
    stop_on_signals,
};

use super::args::{EngineName, RunArgs};
use super::command_line::CommandLine;
use super::context::{OpenSweep, device, open_sweep};
use super::exit::Exit;
use super::output::Output;
use super::{analyse, failures, plan, slurm};

pub fn run(args: &RunArgs, output: &Output) -> Result<Exit> {
    match args.engine {
        EngineName::Slurm if args.fail_fast => {
            bail!("--fail-fast is for this machine; on Slurm the other runs go on")
        }
        EngineName::Slurm => slurm::run(args, output),
        EngineName::Local if args.dry_run || args.profile.is_some() => {
            bail!(
                "--dry-run and --profile want --engine slurm; see `isoflop plan` for this machine"
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
    prepare(&open, args.retry_failed)?;
    CommandLine::of(args)?.write(&open.folder)?;
    let jobs = missing_jobs(&open.plan, &open.folder);
    let reports = train(args, &open, &held, jobs, output)?;
    if interrupted(&reports, args.fail_fast) {
        output.note("interrupted; the same command goes on from here");
        return Ok(Exit::Interrupted);
    }
    analyse::finish(&open.folder, output)?;
    failures::report(args, &open.plan, &open.folder, &reports, output)
}

/// Whether a signal stopped jobs, and not a failure under `--fail-fast`.
fn interrupted(reports: &[JobReport], fail_fast: bool) -> bool {
    let failed = |report: &JobReport| matches!(report.end, JobEnd::Failed(_) | JobEnd::Crashed(_));
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

/// Writes down what workers read: the resolved sweep, the plan, what each job is to make.
pub fn prepare(open: &OpenSweep, retry_failed: bool) -> Result<()> {
    let OpenSweep { sweep, plan, folder } = open;
    for place in [folder.root(), &folder.file("figures")] {
        atomic::remove_partial(place).context("removing half-written files")?;
    }
    atomic::write_bytes(&folder.file("sweep.yaml"), serde_yaml::to_string(sweep)?.as_bytes())?;
    atomic::write_json(&folder.file("plan.json"), &plan::json(plan, folder))?;
    for job in &plan.tokenizers {
        write_once(&folder.tokenizer(&job.id()).join("job.json"), job)?;
    }
    for trunk in &plan.trunks {
        let job = JobId::new(JobKind::Trunk, &trunk.trunk_id);
        // Which trunk it goes on from depends on the sweep's budgets; its result does not.
        atomic::write_json(&folder.job(&job).join("job.json"), trunk)?;
    }
    for run in &plan.runs {
        write_once(&folder.run(&run.run_id).join("spec.json"), &run.spec)?;
    }
    if retry_failed {
        let inputs = inputs(plan).into_iter().map(|job| job.id);
        let runs = plan.runs.iter().map(|run| JobId::run(run.run_id.as_str()));
        inputs.chain(runs).try_for_each(|job| forget_failure(folder, &job))?;
    }
    Ok(())
}

/// Specs lie in folders named by their content, so one that is there is right.
fn write_once(path: &std::path::Path, value: &impl serde::Serialize) -> Result<()> {
    if !path.exists() {
        atomic::write_json(path, value)?;
    }
    Ok(())
}

fn forget_failure(folder: &ResultsFolder, job: &JobId) -> Result<()> {
    Ok(atomic::remove(&folder.job(job).join("failure.json"))?)
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
    };
    let stop = stop_on_signals()?;
    held.watch(&stop);
    let display = Display::new(&jobs, slots, output.quiet);
    let fail_fast = args.fail_fast;
    let pool = LocalPool { runner: &runner, slots, stop: &stop, fail_fast, display: &display };
    let reports = pool.execute(jobs);
    display.clear();
    Ok(reports)
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
