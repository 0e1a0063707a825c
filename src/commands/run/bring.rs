//! Runs the missing jobs of a sweep on an engine.

use super::command_line::{CommandLine, RunArgs};
use super::summary::Summary;
use crate::commands::analyse::planned_runs;
use crate::commands::context::{OpenSweep, open_sweep};
use crate::commands::plan;
use crate::commands::prelude::*;
use isoflop::engine::{Brought, JobEnd, Previewed, SweepRequest};
use isoflop::failure::Failure;
use isoflop::files::set_aside;
use isoflop::jobs::presence::Held;
use isoflop::jobs::{Job, JobId, JobState, all_jobs, gpu, missing_jobs, with_needs, write_specs};
use isoflop::plan::Plan;
use rayon::prelude::*;
use std::collections::HashSet;
use std::fs;
use std::io::ErrorKind;
use std::ops::ControlFlow;

/// Runs the missing jobs that are wanted, and their dependencies. Breaks with the exit code if nothing is left to
/// do afterwards; then it has reported them.
///
/// Locks the folder into `held`, unless `held` has it already: only the holder may write to the folder.
pub fn bring<'a>(
    args: &RunArgs,
    open: &'a OpenSweep,
    held: &mut Option<Held>,
    wanted: impl Fn(&Job) -> bool,
    output: &Output,
) -> Result<ControlFlow<Exit, Summary<'a>>> {
    check_card(open, &wanted)?;
    let (work, options) = (&args.sweep.work, &args.options);
    let request = SweepRequest {
        sweep: &open.sweep,
        plan: &open.plan,
        folder: &open.folder,
        device: work.device,
        slots: work.slots(),
        memory_bytes: options.memory,
        fail_fast: options.fail_fast,
        profile: options.profile.as_deref(),
        track: options.track,
        tell: output,
    };
    let mut session = args.engine.session(&request)?;
    if let Some(preview) = args.preview() {
        let jobs = missing_jobs(&open.plan, &open.folder);
        let Previewed { document, text, taken } = session.preview(preview, jobs)?;
        output.result(&document, &text)?;
        return Ok(ControlFlow::Break(if taken { Exit::Done } else { Exit::Usage }));
    }
    session.begin()?;
    if held.is_none() {
        *held = Some(hold(open, output)?);
    }
    prepare(open, args, output)?;
    let command = CommandLine::of(args)?;
    command.write(&open.folder)?;
    let jobs = with_needs(missing_jobs(&open.plan, &open.folder), wanted);
    let reports = match session.bring(jobs)? {
        Brought::Ended(reports) => reports,
        Brought::HandedOver { document, text } => {
            output.result(&document, &text)?;
            return Ok(ControlFlow::Break(Exit::Done));
        }
    };
    let summary = Summary { open, reports, command };
    let interrupted = interruption(args, &summary, output);
    Ok(interrupted.map_or(ControlFlow::Continue(summary), ControlFlow::Break))
}

/// Reads, plans and warns.
pub fn open(args: &RunArgs, output: &Output) -> Result<OpenSweep> {
    let open = open_sweep(&args.sweep)?;
    args.check_track(&open.sweep)?;
    open.plan.warnings().iter().for_each(|line| output.warn(line));
    if open.plan.runs.is_empty() {
        let first = open.plan.dropped.first().map_or("none was left", |first| &first.reason);
        bail!("every cell of the grid is dropped, the first because {first}");
    }
    Ok(open)
}

/// Refuses missing runs that the card of `engine.gpu` cannot hold.
fn check_card(open: &OpenSweep, wanted: impl Fn(&Job) -> bool) -> Result<()> {
    let OpenSweep { sweep, plan, folder } = open;
    let Some(card) = sweep.engine.as_ref().and_then(|engine| engine.card()) else { return Ok(()) };
    let jobs = with_needs(missing_jobs(plan, folder), wanted);
    let missing: HashSet<&str> = jobs.iter().map(|job| job.id.id.as_str()).collect();
    let runs = plan.runs.iter().filter(|run| missing.contains(run.run_id.as_str()));
    gpu::too_large(card, runs).map_or(Ok(()), |problem| bail!("nothing was run: {problem}"))
}

/// One `run` at a time in a folder.
pub fn hold(open: &OpenSweep, output: &Output) -> Result<Held> {
    let root = open.folder.root().display();
    let waiting =
        || output.note(&format!("another isoflop is at work in {root}; waiting for it to end"));
    Held::take(&open.folder, waiting).with_context(|| format!("cannot make the folder {root} mine"))
}

/// Reports why the jobs ended too early, if they did.
fn interruption(args: &RunArgs, summary: &Summary, output: &Output) -> Option<Exit> {
    let mut ends = summary.reports.iter().map(|report| &report.end);
    let halted = ends.clone().find_map(|end| match end {
        JobEnd::Halted(failure) => Some(failure),
        _ => None,
    });
    if let Some(Failure { kind, reason, .. }) = halted {
        summary.failures(output);
        output.warn(&format!(
            "stopped [{}]: {reason}. Nothing is half-written, and no run is marked as failed: {}, and this goes \
             on: {}",
            kind.word(),
            kind.advice().unwrap_or("mend that"),
            summary.command.said(None, &[])
        ));
        return Some(Exit::SomeRunsFailed);
    }
    let by_failure = args.options.fail_fast && ends.clone().any(|end| end.failure().is_some());
    if by_failure || !ends.any(|end| *end == JobEnd::Stopped) {
        return None;
    }
    summary.failures(output);
    output.note("interrupted; the same command continues from here");
    Some(Exit::Interrupted)
}

// Preparation of the folder before training: its files, and damaged results.

/// Writes the files that workers read: the resolved sweep, the plan, the specification of each job.
pub fn prepare(open: &OpenSweep, args: &RunArgs, output: &Output) -> Result<()> {
    let OpenSweep { sweep, plan, folder } = open;
    for place in [folder.root(), &folder.file("figures")] {
        atomic::remove_partial(place)?;
    }
    mend(plan, folder, output)?;
    keep_former(plan, folder, output)?;
    atomic::write_yaml(&folder.file("sweep.yaml"), &serde_yaml::to_string(sweep)?)?;
    let document = plan::json(plan, folder, &folder.run_states());
    atomic::write_json(&folder.file("plan.json"), &document)?;
    write_specs(plan, folder, &mut |line| output.warn(&line))?;
    forget_failures(args, plan, folder)
}

/// The files about all runs. `plan.json` is moved last: without it the laws cannot be assigned to a sweep.
const OF_ALL_RUNS: [&str; 8] = [
    "sweep.yaml",
    "runs.parquet",
    "runs.csv",
    "prediction.json",
    "figures",
    "generators",
    "laws.json",
    "plan.json",
];

/// If the laws rest on runs that this sweep does not have (another grid under the same name), keeps them in a
/// separate folder with table, figures and sweep; the runs stay where they are.
fn keep_former(plan: &Plan, folder: &ResultsFolder, output: &Output) -> Result<()> {
    let has_laws = folder.file("laws.json").exists() || folder.generators().exists();
    let former = planned_runs(folder).ok().flatten().filter(|_| has_laws).unwrap_or_default();
    let states = folder.run_states();
    let own: HashSet<&String> = plan.runs.iter().map(|run| &run.run_id).collect();
    let finished: Vec<String> =
        former.into_iter().filter(|id| states.of(id) == JobState::Done).collect();
    let gone = finished.iter().filter(|id| !own.contains(id)).count();
    if gone == 0 {
        return Ok(());
    }
    let free = |n: &usize| !folder.file(format!("earlier-{n}")).exists();
    let kept = folder.file(format!("earlier-{}", (1..).find(free).expect("some number is free")));
    fs::create_dir_all(&kept).with_context(|| format!("making {}", kept.display()))?;
    for name in OF_ALL_RUNS {
        match fs::rename(folder.file(name), kept.join(name)) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                return Err(error).with_context(|| format!("moving {name} to {}", kept.display()));
            }
            _ => {}
        }
    }
    output.warn(&format!(
        "{} held laws of {} runs, of which this sweep does not have {gone}: they are kept in {}",
        folder.root().display(),
        finished.len(),
        kept.display()
    ));
    Ok(())
}

/// Sets unreadable results aside, so that they are made again; each is a warning.
fn mend(plan: &Plan, folder: &ResultsFolder, output: &Output) -> Result<()> {
    let jobs: Vec<Job> = all_jobs(plan).collect();
    let damaged = |job: &Job| match folder.inspect(&job.id) {
        Err(error @ FileError::Damaged { .. }) => Some((folder.product(&job.id), error)),
        _ => None,
    };
    for (path, problem) in jobs.par_iter().filter_map(damaged).collect::<Vec<_>>() {
        set_aside(&path)?;
        output.warn(&format!("{problem}: done"));
    }
    Ok(())
}

/// Deletes the failures to retry.
fn forget_failures(args: &RunArgs, plan: &Plan, folder: &ResultsFolder) -> Result<()> {
    if !args.options.retry_failed && args.options.retry.is_empty() {
        return Ok(());
    }
    let jobs: Vec<Job> = all_jobs(plan).collect();
    let forgotten: HashSet<&JobId> = match args.options.retry_failed {
        true => jobs.iter().map(|job| &job.id).collect(),
        false => of_ids(&jobs, &args.options.retry)?,
    };
    for job in forgotten {
        atomic::remove(&folder.job(job).join("failure.json"))?;
    }
    Ok(())
}

/// The jobs of these ids and their dependencies, in order of dependency.
fn of_ids<'a>(jobs: &'a [Job], ids: &[String]) -> Result<HashSet<&'a JobId>> {
    if let Some(id) = ids.iter().find(|id| jobs.iter().all(|job| job.id.id != **id)) {
        bail!(
            "--retry {id}: the sweep has no job of this id; `isoflop status` names those that failed"
        );
    }
    let mut wanted = HashSet::new();
    for job in jobs.iter().rev() {
        if ids.contains(&job.id.id) || wanted.contains(&job.id) {
            wanted.insert(&job.id);
            wanted.extend(&job.needs);
        }
    }
    Ok(wanted)
}
