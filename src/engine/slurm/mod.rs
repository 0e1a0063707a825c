//! Runs a sweep on a cluster, through Slurm's plain command line.
//!
//! The jobs of a plan become array tasks; each runs a list of jobs as `isoflop run` would on one machine. The state is
//! read from files, never from Slurm: a job is done if it has a record.
//!
//! ```text
//! inputs (one task per tokenizer) --afterok--> train (arrays of packed runs) --afterany--> fit
//! ```

mod cluster;
mod command;
mod files;
mod packing;
mod stages;
mod submission;
mod worker;

pub use command::SlurmError;

use self::cluster::{Cluster, of_folder, settings_of, status};
use self::command::{QUERY, Settings, Shell, System};
use self::files::{Entry, Queue, QueuedTask, SlurmFolder};
use self::stages::{After, Array};
use self::submission::{Submission, Verdict};
use crate::engine::runner::{Brought, Engine, FitTerms, Preview, Previewed, Session, Task};
use crate::engine::{Cancelled, EngineState, SweepRequest, Tell};
use crate::jobs::presence::{ask_no_more, ask_to_end};
use crate::jobs::{Job, JobKind, ResultsFolder, SweepState};
use crate::sweep::read_profile;
use crate::units::quoted;
use anyhow::{Context, Result, bail};
use serde_json::json;
use std::path::absolute;
use std::time::{Duration, Instant};

/// Jobs on a cluster; submits them and returns at once.
pub struct Slurm;

impl Engine for Slurm {
    fn name(&self) -> &'static str {
        "slurm"
    }

    fn about(&self) -> &'static str {
        "Jobs on a cluster; submits them and returns at once"
    }

    fn hands_over(&self) -> bool {
        true
    }

    fn session<'a>(&self, request: &'a SweepRequest<'a>) -> Result<Box<dyn Session + 'a>> {
        if request.fail_fast {
            bail!("--fail-fast is for this machine; on Slurm the other runs go on");
        }
        let folder = ResultsFolder::new(absolute(request.folder.root())?);
        let settings = settings(request)?;
        let (entries, queue, held, asked) = Default::default();
        Ok(Box::new(Cluster { request, folder, settings, entries, queue, held, asked }))
    }

    fn status(&self, folder: &ResultsFolder, state: &SweepState) -> Result<Option<EngineState>> {
        status(folder, state)
    }

    fn cancel(&self, folder: &ResultsFolder, tell: &dyn Tell) -> Result<Cancelled> {
        let Some((settings, entries)) = of_folder(folder)? else {
            return Ok(Cancelled::NothingRan);
        };
        tell.note("asking Slurm; where something runs, its checkpoints are waited for");
        Ok(cancel(folder, &settings, &entries)?)
    }

    fn task(&self, folder: &ResultsFolder, task: &Task, say: &dyn Fn(&str)) -> Result<i32> {
        let program = std::env::current_exe().context("finding this program")?;
        Ok(worker::work(folder, task, program, say)? as i32)
    }

    fn fit_terms(&self, folder: &ResultsFolder, submission: Option<u32>) -> Result<FitTerms> {
        let settings = settings_of(&SlurmFolder::of(folder), submission)?;
        let (grace, allow_missing) = (settings.fs_grace(), settings.allow_missing());
        Ok(FitTerms { grace, allow_missing })
    }
}

/// The section of the sweep, overridden by the profile; each task of the runs has the trainer's GPUs, or one if a card
/// is named.
fn settings(request: &SweepRequest) -> Result<Settings> {
    let engine = request.sweep.engine.clone().unwrap_or_default();
    let (has_card, of_sweep) = (engine.gpu.is_some(), engine.slurm);
    let settings = Settings(match request.profile {
        Some(path) => read_profile(path)?.over(of_sweep),
        None => of_sweep,
    });
    let shared = request.sweep.trainer.as_ref().and_then(|trainer| trainer.gpus);
    Ok(match shared.or(has_card.then_some(1)) {
        Some(n) => settings.with_gpus(n),
        None => settings,
    })
}

/// MaxArraySize; also shows whether the controller answers.
fn max_array(settings: &Settings) -> Result<Option<usize>, SlurmError> {
    let said = System.ask(&settings.program("scontrol", &["show", "config"]), QUERY)?;
    let line = said.lines().find(|line| line.starts_with("MaxArraySize"));
    Ok(line.and_then(|line| line.split('=').nth(1)?.trim().parse().ok()))
}

impl Session for Cluster<'_> {
    /// Slurm must answer before anything is changed.
    fn begin(&mut self) -> Result<()> {
        self.asked = max_array(&self.settings).context("nothing was submitted or changed")?;
        self.look()
            .context("what is in the queue is not known, so nothing was submitted or changed")
    }

    fn bring(mut self: Box<Self>, jobs: Vec<Job>) -> Result<Brought> {
        self.held = self.queue.held(&self.entries, &SlurmFolder::of(&self.folder))?;
        let left = jobs.iter().filter(|job| !self.held.contains_key(&job.id)).count();
        if left == 0 && self.has_fit() {
            return Ok(self.in_the_queue());
        }
        if left == 0 && !self.queue.is_active() {
            return Ok(Brought::Ended(Vec::new()));
        }
        let (generation, submitted) = self.submit(&jobs)?;
        Ok(self.submitted(generation, &submitted, left))
    }

    fn preview(&mut self, preview: Preview, jobs: Vec<Job>) -> Result<Previewed> {
        if jobs.is_empty() {
            bail!("nothing is missing, so there is nothing to submit");
        }
        if preview == Preview::Check {
            self.asked = max_array(&self.settings)?;
        }
        let (estimates, most) = (self.estimates()?, self.settings.max_submit());
        // By a program that is not copied yet.
        let submission = self.submission(&jobs, "PROGRAM", &estimates, most)?;
        match preview {
            Preview::DryRun => Ok(dry_run(&submission, jobs.len())),
            Preview::Check => check(&self.request.sweep.name, &submission),
        }
    }
}

impl Cluster<'_> {
    /// The ledger, and Slurm's state of its jobs. An entry without a number comes from an interrupted submission: its job
    /// is searched, and the entry completed.
    fn look(&mut self) -> Result<()> {
        let ledger = SlurmFolder::of(&self.folder);
        let entries = ledger.entries()?;
        self.queue = Queue::ask(&System, &self.settings, &entries)?;
        for entry in entries.iter().filter(|entry| entry.job_id.is_none()) {
            match self.queue.of(entry).next() {
                Some(QueuedTask { job_id, .. }) => {
                    ledger.write(&Entry { job_id: Some(job_id.clone()), ..entry.clone() })?;
                }
                None => ledger.take_back(entry)?,
            }
        }
        self.entries = ledger.entries()?;
        Ok(())
    }

    /// Whether a fit is in the queue: a submission that was cut off may have got none.
    fn has_fit(&self) -> bool {
        let fits = self.entries.iter().filter(|entry| entry.tasks.is_none());
        fits.flat_map(|entry| self.queue.of(entry)).any(QueuedTask::is_active)
    }

    fn how_far(&self) -> String {
        let root = self.folder.root().display().to_string();
        format!("how far it is: isoflop status {}", quoted(&root))
    }

    fn in_the_queue(&self) -> Brought {
        let active = self.queue.tasks.iter().filter(|task| task.is_active()).count();
        let results = self.folder.root();
        let document = json!({"submitted": [], "active_tasks": active, "results": results});
        let text = format!(
            "all missing jobs are in Slurm's queue already, in {active} tasks\n{}",
            self.how_far()
        );
        Brought::HandedOver { document, text }
    }

    fn submitted(&self, generation: u32, entries: &[Entry], left: usize) -> Brought {
        let taken =
            |own: &Entry| json!({"name": own.array, "job_id": own.job_id, "tasks": own.tasks});
        let submitted: Vec<_> = entries.iter().map(taken).collect();
        let results = self.folder.root();
        let document =
            json!({"generation": generation, "submitted": submitted, "results": results});
        let line = |Entry { array, job_id, tasks, .. }: &Entry| {
            let tasks = match tasks {
                Some(1) => "1 task".to_string(),
                Some(tasks) => format!("{tasks} tasks"),
                None => "after all others".to_string(),
            };
            format!("  {array:<12} job {:<10} {tasks}\n", job_id.as_deref().unwrap_or_default())
        };
        let text = format!(
            "{}: {left} jobs submitted\n{}{}",
            self.request.sweep.name,
            entries.iter().map(line).collect::<String>(),
            self.how_far()
        );
        Brought::HandedOver { document, text }
    }
}

// The preview of a submission (`--dry-run`), and Slurm's answer to it (`--check`).

/// The submission for an empty queue: scripts, and calls with placeholders for job numbers and tokens.
fn dry_run(submission: &Submission, n_jobs: usize) -> Previewed {
    let steps = &submission.steps;
    let ids: Vec<String> = steps.iter().map(|step| format!("ID_OF_{}", step.name)).collect();
    let (mut text, mut documents) = (String::new(), Vec::new());
    for (at, step) in steps.iter().enumerate() {
        let words = submission.words(step, "TOKEN", &ids[..at]);
        let path = submission.files().script(submission.generation, &step.name);
        let (jobs, script) = (counts(step), submission.script(step));
        text += &format!("# {}{jobs}\n", step.name);
        // As a shell reads it, over several lines.
        let call: Vec<String> = words.iter().map(|word| quoted(word)).collect();
        text += &format!("{}\n\n# {}\n{script}\n", call.join(" \\\n  "), path.display());
        documents.push(json!({"name": step.name, "sbatch": words, "script": script}));
    }
    let document = json!({"jobs": n_jobs, "submissions": documents});
    Previewed { document, text, taken: true }
}

/// `: 2 tasks, 12 × run`; nothing of the fit.
fn counts(array: &Array) -> String {
    let Some(tasks) = array.tasks() else { return String::new() };
    let jobs = || array.chunks.iter().flat_map(|chunk| &chunk.jobs);
    let named = JobKind::ALL.into_iter().filter_map(|kind| {
        let n = jobs().filter(|timed| timed.job.id.kind == kind).count();
        (n > 0).then(|| format!("{n} × {}", kind.word()))
    });
    let named: Vec<String> = named.collect();
    let waits = array.after.iter().any(|after| matches!(after, After::Queued(_)));
    let waits = if waits { ", after jobs in the queue" } else { "" };
    format!(": {tasks} tasks, {}{waits}", named.join(", "))
}

/// Asks Slurm whether it would take each step if the queue were empty; changes nothing.
///
/// # Errors
/// Slurm gave no answer.
fn check(sweep: &str, submission: &Submission) -> Result<Previewed> {
    let verdicts = submission.verdicts().context("asking Slurm")?;
    let line = |verdict: &Verdict| {
        let word = if verdict.taken { "taken" } else { "REFUSED" };
        format!("  {:<9} {word:<8} {}\n", verdict.name, verdict.said)
    };
    let taken = verdicts.iter().all(|verdict| verdict.taken);
    let end = match taken {
        true => "Slurm would take it; whether its nodes see this folder only a job can tell",
        false => "Slurm would not take it so; docs/cluster.md lists the keys of the profile",
    };
    let lines: String = verdicts.iter().map(line).collect();
    let text = format!("{sweep}: nothing is submitted\n{lines}{end}");
    Ok(Previewed { document: json!({"taken": taken, "steps": verdicts}), text, taken })
}

// Ends Slurm's jobs of a sweep: waiting ones first, then running ones, with time for checkpoints.

const POLL: Duration = Duration::from_millis(500);

/// Time for killed jobs to disappear.
const KILLED: Duration = Duration::from_secs(60);

/// Ends the jobs of the entries, by their numbers alone.
///
/// # Errors
/// Slurm gave no answer: then nothing is known, and the sweep may go on.
fn cancel(
    folder: &ResultsFolder,
    settings: &Settings,
    entries: &[Entry],
) -> Result<Cancelled, SlurmError> {
    let look = || Queue::ask(&System, settings, entries);
    if !look()?.is_active() {
        return Ok(Cancelled::NothingRan);
    }
    // Tasks look for this too: one may be starting just now.
    ask_to_end(folder)?;
    let call = |arguments: &[&str], ids: Vec<String>| {
        // A job that has ended meanwhile is no error.
        System.call(&[settings.program("scancel", arguments), ids].concat(), QUERY)
    };
    let mut asked = false;
    let gone = until(settings.cancel_grace(), || {
        let queue = look()?;
        let ids = queue.active_jobs();
        if ids.is_empty() {
            return Ok(true);
        }
        // Waiting jobs first: the fit would start when the jobs before it end.
        call(&["--state=PENDING"], ids.clone())?;
        if !asked {
            call(&["--batch", "--signal=TERM"], ids)?;
            asked = true;
        }
        Ok(false)
    })?;
    let killed = !gone && {
        call(&[], look()?.active_jobs())?;
        until(KILLED, || Ok(!look()?.is_active()))?
    };
    ask_no_more(folder)?;
    Ok(match (gone, killed) {
        (true, _) => Cancelled::Ended,
        (false, true) => Cancelled::Killed,
        (false, false) => Cancelled::StillAtWork,
    })
}

fn until(
    limit: Duration,
    mut look: impl FnMut() -> Result<bool, SlurmError>,
) -> Result<bool, SlurmError> {
    let started = Instant::now();
    loop {
        if look()? {
            return Ok(true);
        }
        if started.elapsed() > limit {
            return Ok(false);
        }
        std::thread::sleep(POLL);
    }
}
