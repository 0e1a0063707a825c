//! `isoflop run --engine slurm`: what is missing of a sweep, given to Slurm.

use std::path::PathBuf;

use anyhow::{Context, Result};
use isoflop::record::ResultsFolder;
use isoflop::schedule::missing_jobs;
use isoflop::slurm::{
    Entry, Ledger, QUERY, Queue, Settings, Shell, SlurmError, SlurmFolder, Submitted, System, Task,
    Written,
};
use isoflop::sweep::read_profile;
use serde_json::json;

use super::args::RunArgs;
use super::command_line::CommandLine;
use super::context::OpenSweep;
use super::exit::Exit;
use super::failures::Summary;
use super::output::Output;
use super::prepare::prepare;
use super::slurm_request::Request;
use super::{analyse, run, slurm_preview};

/// Submits what is missing and returns at once.
pub fn run(args: &RunArgs, output: &Output) -> Result<Exit> {
    let OpenSweep { sweep, plan, folder } = run::open(args, output)?;
    let folder = ResultsFolder::new(std::path::absolute(folder.root())?);
    let open = OpenSweep { sweep, plan, folder };
    let settings = settings(args, &open)?;
    if args.dry_run {
        return slurm_preview::dry_run(args, &open, settings, output);
    }
    let shell = System;
    if args.check {
        return slurm_preview::check(args, &open, settings, &shell, output);
    }
    // Slurm must answer before anything is changed.
    let asked = max_array(&settings, &shell).context("nothing was submitted or changed")?;
    let held = run::hold(&open.folder, output)?;
    let (entries, queue) = queue(&open.folder, &settings, &shell)
        .context("what is in the queue is not known, so nothing was submitted or changed")?;
    prepare(&open, args, output)?;
    CommandLine::of(args)?.write(&open.folder)?;
    let files = SlurmFolder::of(&open.folder);
    let held_jobs = queue.held(&entries, &files)?;
    let jobs = missing_jobs(&open.plan, &open.folder);
    let left = jobs.iter().filter(|job| !held_jobs.contains_key(&job.id)).count();
    if left == 0 && has_fit(&entries, &queue) {
        return in_the_queue(&open, &queue, output);
    }
    if left == 0 && !queue.is_active() {
        drop(held);
        analyse::finish(&open.folder, output)?;
        let summary = Summary::new(args, &open.plan, &open.folder, &[])?;
        return Ok(summary.tell(output));
    }
    let active = queue.active_jobs();
    let request = Request { args, open: &open, settings, jobs, queued: held_jobs, active, asked };
    let (generation, submitted) = request.submit(&shell, output)?;
    report(&open, generation, &submitted, left, output)
}

/// The section of the sweep, under that of the profile.
fn settings(args: &RunArgs, open: &OpenSweep) -> Result<Settings> {
    let of_sweep = open.sweep.engine.clone().unwrap_or_default().slurm;
    let section = match &args.profile {
        Some(path) => read_profile(path)?.over(of_sweep),
        None => of_sweep,
    };
    Ok(Settings::new(section))
}

/// MaxArraySize; also shows whether the controller answers.
pub fn max_array(settings: &Settings, shell: &dyn Shell) -> Result<Option<usize>, SlurmError> {
    let mut words = settings.program("scontrol");
    words.extend(["show", "config"].map(String::from));
    let said = shell.ask(&words, QUERY)?;
    let line = said.lines().find(|line| line.starts_with("MaxArraySize"));
    Ok(line.and_then(|line| line.split('=').nth(1)?.trim().parse().ok()))
}

/// The ledger and what Slurm says of it. An entry without a number is of a submission that was cut
/// off: its job is looked for, and the entry settled.
fn queue(
    folder: &ResultsFolder,
    settings: &Settings,
    shell: &dyn Shell,
) -> Result<(Vec<Entry>, Queue)> {
    let ledger = Ledger::of(&SlurmFolder::of(folder));
    let entries = ledger.entries()?;
    let queue = Queue::ask(shell, settings, &entries)?;
    for entry in entries.iter().filter(|entry| entry.job_id.is_none()) {
        match queue.of(entry).next() {
            Some(task) => {
                let job_id = Some(task.job_id.clone());
                ledger.write(&Entry { job_id, ..entry.clone() })?;
            }
            None => ledger.take_back(entry)?,
        }
    }
    Ok((ledger.entries()?, queue))
}

/// Whether a fit is in the queue: a submission that was cut off may have got none.
fn has_fit(entries: &[Entry], queue: &Queue) -> bool {
    let fits = entries.iter().filter(|entry| entry.tasks.is_none());
    fits.flat_map(|entry| queue.of(entry)).any(Task::is_active)
}

fn in_the_queue(open: &OpenSweep, queue: &Queue, output: &Output) -> Result<Exit> {
    let active = queue.tasks.iter().filter(|task| task.is_active()).count();
    let document = json!({"submitted": [], "active_tasks": active, "results": open.folder.root()});
    let text = format!(
        "everything that is missing is in Slurm's queue already, in {active} tasks\n\
         how far it is: isoflop status {}",
        CommandLine::quoted(&open.folder.root().display().to_string())
    );
    output.result(&document, &text)?;
    Ok(Exit::Done)
}

fn report(
    open: &OpenSweep,
    generation: u32,
    submitted: &[Submitted],
    left: usize,
    output: &Output,
) -> Result<Exit> {
    let root = open.folder.root();
    let document = json!({"generation": generation, "submitted": submitted, "results": root});
    let tasks = |job: &Submitted| match job.tasks {
        Some(1) => "1 task".to_string(),
        Some(tasks) => format!("{tasks} tasks"),
        None => "after all others".to_string(),
    };
    let line =
        |job: &Submitted| format!("  {:<12} job {:<10} {}\n", job.name, job.job_id, tasks(job));
    let text = format!(
        "{}: {left} jobs submitted\n{}how far it is: isoflop status {}",
        open.sweep.name,
        submitted.iter().map(line).collect::<String>(),
        CommandLine::quoted(&root.display().to_string())
    );
    output.result(&document, &text)?;
    Ok(Exit::Done)
}

/// The settings, the ledger and the queue of a folder that a command looks into; `None` where nothing
/// was ever submitted from it.
pub fn of_folder(folder: &ResultsFolder) -> Result<Option<(Settings, Vec<Entry>)>> {
    let folder = ResultsFolder::new(std::path::absolute(folder.root())?);
    let files = SlurmFolder::of(&folder);
    let Some(generation) = files.latest()? else { return Ok(None) };
    let path: PathBuf = files.written(generation);
    let written: Option<Written> = isoflop::record::read_if_there(&path)?;
    let settings = Settings::new(written.map(|written| written.settings).unwrap_or_default());
    Ok(Some((settings, Ledger::of(&files).entries()?)))
}
