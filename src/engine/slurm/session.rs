//! [`Slurm`]: jobs of a cluster, submitted at once and done some time.

use std::collections::HashMap;
use std::path::absolute;

use anyhow::{Context, Result, bail};
use serde_json::json;

use super::cancel::cancel;
use super::cluster::{Cluster, of_folder, settings_of};
use super::command::{QUERY, Shell, System};
use super::error::SlurmError;
use super::files::SlurmFolder;
use super::ledger::Entry;
use super::packing::Packed;
use super::preview;
use super::queue::{Queue, QueuedTask};
use super::settings::Settings;
use super::status::status;
use super::worker::ChunkWorker;
use crate::engine::contract::{Brought, Engine, FitTerms, Preview, Previewed, Session, Task};
use crate::engine::{Cancelled, EngineState, SweepRequest, Tell};
use crate::jobs::{Job, ResultsFolder, SweepState};
use crate::sweep::read_profile;
use crate::units::quoted;

/// Jobs of a cluster: submits them and returns at once.
pub struct Slurm;

impl Engine for Slurm {
    fn name(&self) -> &'static str {
        "slurm"
    }

    fn about(&self) -> &'static str {
        "Jobs of a cluster: submits them and returns at once"
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
        let queue = Queue::default();
        Ok(Box::new(Cluster { request, folder, settings, entries: Vec::new(), queue, asked: None }))
    }

    fn status(&self, folder: &ResultsFolder, state: &SweepState) -> Result<Option<EngineState>> {
        status(folder, state)
    }

    fn cancel(&self, folder: &ResultsFolder, tell: &dyn Tell) -> Result<Cancelled> {
        let Some((settings, entries)) = of_folder(folder)? else {
            return Ok(Cancelled::NothingRan);
        };
        tell.note("asking Slurm; where something runs, its checkpoints are waited for");
        Ok(cancel(folder, &settings, &entries, &System)?)
    }

    fn task(&self, folder: &ResultsFolder, task: &Task, say: &dyn Fn(&str)) -> Result<i32> {
        let worker = ChunkWorker { folder: folder.clone(), task: task.clone() };
        let program = std::env::current_exe().context("finding this program")?;
        Ok(worker.work(program, &System, say)? as i32)
    }

    fn fit_terms(&self, folder: &ResultsFolder, submission: Option<u32>) -> Result<FitTerms> {
        let settings = settings_of(&SlurmFolder::of(folder), submission)?;
        let (grace, allow_missing) = (settings.fs_grace(), settings.allow_missing());
        Ok(FitTerms { grace, allow_missing })
    }
}

/// The section of the sweep, under that of the profile; each task of the runs has the GPUs that the trainer shares
/// out, or, with a card, one.
fn settings(request: &SweepRequest) -> Result<Settings> {
    let engine = request.sweep.engine.clone().unwrap_or_default();
    let (has_card, of_sweep) = (engine.card().is_some(), engine.slurm);
    let section = match request.profile {
        Some(path) => read_profile(path)?.over(of_sweep),
        None => of_sweep,
    };
    let settings = Settings(section);
    let shared = request.sweep.trainer.as_ref().and_then(|trainer| trainer.gpus);
    Ok(match shared.or(has_card.then_some(1)) {
        Some(n) => settings.with_gpus(n),
        None => settings,
    })
}

/// MaxArraySize; also shows whether the controller answers.
pub fn max_array(settings: &Settings, shell: &dyn Shell) -> Result<Option<usize>, SlurmError> {
    let said = shell.ask(&settings.program("scontrol", &["show", "config"]), QUERY)?;
    let line = said.lines().find(|line| line.starts_with("MaxArraySize"));
    Ok(line.and_then(|line| line.split('=').nth(1)?.trim().parse().ok()))
}

impl Session for Cluster<'_> {
    /// Slurm must answer before anything is changed.
    fn begin(&mut self) -> Result<()> {
        self.asked =
            max_array(&self.settings, &System).context("nothing was submitted or changed")?;
        self.look(&System)
            .context("what is in the queue is not known, so nothing was submitted or changed")
    }

    fn bring(self: Box<Self>, jobs: Vec<Job>) -> Result<Brought> {
        let held = self.queue.held(&self.entries, &SlurmFolder::of(&self.folder))?;
        let left = jobs.iter().filter(|job| !held.contains_key(&job.id)).count();
        if left == 0 && self.has_fit() {
            return Ok(self.in_the_queue());
        }
        if left == 0 && !self.queue.is_active() {
            return Ok(Brought::Ended(Vec::new()));
        }
        let packed = Packed { jobs: &jobs, queued: &held };
        let (generation, submitted) = self.submit(&packed, &System)?;
        Ok(self.submitted(generation, &submitted, left))
    }

    fn preview(&mut self, preview: Preview, jobs: Vec<Job>) -> Result<Previewed> {
        if jobs.is_empty() {
            bail!("nothing is missing, so there is nothing to submit");
        }
        if preview == Preview::Check {
            self.asked = max_array(&self.settings, &System)?;
        }
        let packed = Packed { jobs: &jobs, queued: &HashMap::new() };
        match preview {
            Preview::DryRun => preview::dry_run(self, &packed),
            Preview::Check => preview::check(self, &packed, &System),
        }
    }
}

impl Cluster<'_> {
    /// The ledger and what Slurm says of it. An entry without a number is of a submission that was
    /// cut off: its job is looked for, and the entry settled.
    fn look(&mut self, shell: &dyn Shell) -> Result<()> {
        let ledger = SlurmFolder::of(&self.folder);
        let entries = ledger.entries()?;
        self.queue = Queue::ask(shell, &self.settings, &entries)?;
        for entry in entries.iter().filter(|entry| entry.job_id.is_none()) {
            match self.queue.of(entry).next() {
                Some(task) => {
                    let job_id = Some(task.job_id.clone());
                    ledger.write(&Entry { job_id, ..entry.clone() })?;
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
        let taken = |entry: &Entry| {
            let Entry { array, job_id, tasks, .. } = entry;
            json!({"name": array, "job_id": job_id, "tasks": tasks})
        };
        let (results, submitted) =
            (self.folder.root(), entries.iter().map(taken).collect::<Vec<_>>());
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
