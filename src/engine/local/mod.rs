//! Runs jobs on this machine: one watched worker process per job.

mod display;
mod gpus;
mod pool;
mod processes;
mod traces;

pub use display::{Display, left};
pub use gpus::Gpus;
pub use pool::LocalPool;
pub use processes::LocalProcesses;

use self::traces::{Spent, Timeline};
use crate::engine::runner::{Brought, Cancelled, Engine, Session, SweepRequest, Tell};
use crate::jobs::presence::{ask_no_more, ask_to_end, is_held, stop_when_asked};
use crate::jobs::speed::{self, Finished, Speed, known};
use crate::jobs::{Job, JobId, JobState, ResultsFolder, time_left};
use crate::machine;
use crate::progress::stop_on_signals;
use anyhow::{Context, Result};
use std::collections::HashSet;
use std::path::PathBuf;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// Processes on this machine; returns when all are done.
pub struct Local;

/// FLOPs of jobs that take a minute or more.
const WORTH_A_PROBE: f64 = 1e12;

/// Far longer than a step and a checkpoint take.
const PATIENCE: Duration = Duration::from_secs(60);
const POLL: Duration = Duration::from_millis(100);

impl Engine for Local {
    fn name(&self) -> &'static str {
        "local"
    }

    fn about(&self) -> &'static str {
        "Processes on this machine; returns when all are done"
    }

    fn session<'a>(&self, request: &'a SweepRequest<'a>) -> Result<Box<dyn Session + 'a>> {
        request.device.open()?;
        Ok(Box::new(Here(request)))
    }

    /// Asks for an end until the folder is free. A process that waits for the folder is asked too when it starts.
    fn cancel(&self, folder: &ResultsFolder, tell: &dyn Tell) -> Result<Cancelled> {
        if !is_held(folder) {
            return Ok(Cancelled::NothingRan);
        }
        tell.note("asked for an end; waiting for checkpoints to be written");
        let asked = Instant::now();
        // Another process may take over the lock right afterwards.
        let is_held_again = || {
            std::thread::sleep(POLL);
            is_held(folder)
        };
        while is_held(folder) || is_held_again() {
            if asked.elapsed() > PATIENCE {
                return Ok(Cancelled::StillAtWork);
            }
            // A scheduler that has just started ignores earlier requests.
            ask_to_end(folder)?;
            std::thread::sleep(POLL);
        }
        ask_no_more(folder)?;
        Ok(Cancelled::Ended)
    }
}

/// A request to be met by this machine.
struct Here<'a>(&'a SweepRequest<'a>);

impl Session for Here<'_> {
    fn bring(self: Box<Self>, jobs: Vec<Job>) -> Result<Brought> {
        let SweepRequest { sweep, plan, folder, tell, .. } = *self.0;
        let all = plan.runs.len();
        let (n_jobs, states) = (jobs.len(), folder.run_states());
        let state = plan.runs.iter().map(|run| states.of(&run.run_id));
        let ended = state.filter(|of| matches!(of, JobState::Done | JobState::Failed)).count();
        if jobs.is_empty() {
            tell.note(&format!(
                "{ended} of {all} runs finished or failed before; nothing to train"
            ));
            return Ok(Brought::Ended(Vec::new()));
        }
        let slots = self.0.slots.min(n_jobs);
        tell.note(&format!(
            "{n_jobs} jobs to do, {ended} of {all} runs finished or failed before; {slots} at a time"
        ));
        let runner = LocalProcesses {
            folder: folder.clone(),
            device: self.0.device.name().to_string(),
            program: own_program()?,
            gpus: Gpus::of_sweep(sweep, slots)?,
            hang: sweep.train.hang(),
            track: self.0.track,
            untracked: OnceLock::new(),
        };
        let stop = stop_on_signals()?;
        stop_when_asked(folder, &stop);
        self.note_speed(&jobs, slots)?;
        let wanted: HashSet<JobId> = jobs.iter().map(|job| job.id.clone()).collect();
        let own = folder.clone();
        let left = move || time_left(&own, slots, &|id| wanted.contains(id)).ok().flatten();
        let display = Display::new(&jobs, slots, tell.is_quiet(), left);
        let timeline = Timeline::open(folder)?;
        let pool = LocalPool {
            runner: &runner,
            slots,
            stop: &stop,
            fail_fast: self.0.fail_fast,
            display: &display,
            memory_bytes: self.memory_bytes(&jobs),
            timeline: Some(&timeline),
        };
        let reports = pool.execute(jobs);
        display.clear();
        runner.untracked().iter().for_each(|line| tell.warn(line));
        tell.note(&time_spent(&timeline.spent(), slots));
        Ok(Brought::Ended(reports))
    }
}

impl Here<'_> {
    /// Times this machine, if the folder has no speeds and the sweep is large enough.
    fn note_speed(&self, jobs: &[Job], slots: usize) -> Result<()> {
        let SweepRequest { plan, folder, device, .. } = *self.0;
        let is_long = jobs.iter().map(|job| job.cost).sum::<f64>() > WORTH_A_PROBE;
        let is_built_in = plan.runs.iter().all(|run| run.spec.trainer.is_none());
        if !is_long || !is_built_in || known(folder, &Finished::of(plan, folder)).is_some() {
            return Ok(());
        }
        let speed = Speed::measured_of(jobs, plan, &device.open()?, slots);
        Ok(speed::note(folder, &speed)?)
    }

    /// Memory for all jobs together; a job that wants more than that is named.
    fn memory_bytes(&self, jobs: &[Job]) -> Option<u64> {
        let bytes = self.0.memory_bytes.or_else(machine::available)?;
        let largest = jobs.iter().max_by_key(|job| job.peak_bytes)?;
        if largest.peak_bytes > bytes {
            let [wanted, there] = [largest.peak_bytes, bytes].map(|bytes| bytes as f64 / 1e9);
            self.0.tell.warn(&format!(
                "{} wants {wanted:.1} GB of memory at its peak, and there are {there:.1} GB: it runs \
                 alone, and may be killed",
                largest.label
            ));
        }
        Some(bytes)
    }
}

/// The use of the slots' time; a user's trainer does not report its steps.
fn time_spent(spent: &Spent, slots: usize) -> String {
    let minutes = spent.span_s / 60.0;
    match 100.0 * spent.training_share(slots) {
        0.0 => format!("{minutes:.1} min"),
        share => format!("{minutes:.1} min; the cores trained for {share:.0} % of it"),
    }
}

/// This program's executable, by its image in memory if possible, so that workers are the same build even if the file
/// was replaced or removed.
fn own_program() -> Result<PathBuf> {
    let image = PathBuf::from(format!("/proc/{}/exe", std::process::id()));
    let this = || std::env::current_exe().context("finding this program");
    if image.exists() { Ok(image) } else { this() }
}
