//! [`LocalPool`]: slots of this machine that take the next ready job until none is left.

use std::collections::HashMap;
use std::sync::{Condvar, Mutex, MutexGuard};

use super::waiting::Waiting;
use crate::engine::local::display::Display;
use crate::engine::local::retry::{Next, next};
use crate::engine::local::timeline::Timeline;
use crate::engine::runner::{JobEnd, JobReport, Runner};
use crate::failure::Failure;
use crate::jobs::{Job, JobId};
use crate::progress::{Beat, Stop};

/// Slots that do jobs side by side, the most urgent first.
pub struct LocalPool<'a> {
    pub runner: &'a dyn Runner,
    pub slots: usize,
    pub stop: &'a Stop,
    /// Stop all at the first failure.
    pub fail_fast: bool,
    pub display: &'a Display,
    /// Bytes that jobs may take together at their peaks; `None`: as much as they want. One job is
    /// started whatever it takes.
    pub memory_bytes: Option<u64>,
    /// Where it is noted what ran when.
    pub timeline: Option<&'a Timeline>,
}

impl LocalPool<'_> {
    /// Brings jobs to their end, each after what it needs; returns how each ended.
    ///
    /// A job whose needs failed is not started and is reported as failed with that reason. Jobs not
    /// started because of a stop are reported as stopped. A slot whose thread the system refuses stays
    /// empty.
    pub fn execute(&self, jobs: Vec<Job>) -> Vec<JobReport> {
        let shared = Shared::new(jobs, self.memory_bytes);
        std::thread::scope(|scope| {
            for slot in 1..self.slots {
                let shared = &shared;
                let serve = move || self.serve(slot, shared);
                if let Err(error) = std::thread::Builder::new().spawn_scoped(scope, serve) {
                    self.display.warn(&format!("{slot} jobs side by side and no more: {error}"));
                    break;
                }
            }
            self.serve(0, &shared);
        });
        shared.state.into_inner().expect("no slot panicked").reports
    }

    /// One slot's work, from its first job to the end.
    fn serve(&self, slot: usize, shared: &Shared) {
        while let Some(job) = shared.take(slot, self.stop) {
            let Some(end) = self.attempt(&job, slot, shared) else {
                shared.put_back(slot, job);
                continue;
            };
            if matches!(end, JobEnd::Halted(_))
                || self.fail_fast && matches!(end, JobEnd::Failed(_))
            {
                self.stop.raise();
            }
            self.display.ended(slot, &job, &end);
            shared.put(slot, JobReport { job, end });
        }
        self.display.idle(slot);
    }

    /// Starts a job, and again where its process died; `None` where that must wait until it can run
    /// alone.
    fn attempt(&self, job: &Job, slot: usize, shared: &Shared) -> Option<JobEnd> {
        loop {
            let end = self.once(job, slot);
            let sentence = end.failure().map(|failure| failure.reason.clone()).unwrap_or_default();
            let warn =
                |what: &str| self.display.warn(&format!("{}: {sentence}; {what}", job.label));
            match next(end, shared.tries(&job.id), self.stop.is_raised()) {
                Next::End(end) => return Some(end),
                Next::GiveUp(failure) => return Some(self.give_up(job, failure)),
                Next::Again => warn("starting it again"),
                Next::Alone => {
                    warn("it is started again when nothing runs beside it");
                    shared.has_tried(&job.id);
                    return None;
                }
            }
            shared.has_tried(&job.id);
        }
    }

    fn once(&self, job: &Job, slot: usize) -> JobEnd {
        let start_s = self.timeline.map_or(0.0, Timeline::now_s);
        self.display.started(slot, job);
        let mut train_s = 0.0;
        let mut beat = |beat: Beat| {
            train_s = beat.train_s;
            self.display.beat(slot, job, &beat);
        };
        let end = self.runner.run(job, self.stop, &mut beat);
        if let Some(timeline) = self.timeline {
            timeline.note(job, slot, [start_s, train_s], &end);
        }
        end
    }

    /// What died too often has failed, unless not even that can be written down.
    fn give_up(&self, job: &Job, failure: Failure) -> JobEnd {
        let kind = failure.kind;
        let noted = self.runner.give_up(job, failure);
        if noted.kind == kind { JobEnd::Failed(noted) } else { JobEnd::of(noted) }
    }
}

/// What a job is counted as that must run alone.
const ALONE: u64 = u64::MAX;

struct State {
    waiting: Waiting,
    /// Peak bytes of the job of each slot that is at work.
    running: HashMap<usize, u64>,
    /// Times that a job was started before.
    tries: HashMap<JobId, usize>,
    reports: Vec<JobReport>,
}

struct Shared {
    state: Mutex<State>,
    changed: Condvar,
    memory_bytes: u64,
}

impl Shared {
    fn new(jobs: Vec<Job>, memory_bytes: Option<u64>) -> Self {
        let (running, tries) = (HashMap::new(), HashMap::new());
        let state = State { waiting: Waiting::new(jobs), running, tries, reports: Vec::new() };
        let memory_bytes = memory_bytes.unwrap_or(ALONE - 1).min(ALONE - 1);
        Self { state: Mutex::new(state), changed: Condvar::new(), memory_bytes }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().expect("no slot panicked")
    }

    /// The next job that can start; waits for one; `None` when all is done or a stop was asked for.
    fn take(&self, slot: usize, stop: &Stop) -> Option<Job> {
        let mut state = self.lock();
        loop {
            if stop.is_raised() {
                let stopped = state.waiting.drain();
                state.report(stopped, &JobEnd::Stopped);
            }
            if let Some(job) = state.take(self.memory_bytes) {
                state.running.insert(slot, job.peak_bytes);
                return Some(job);
            }
            if state.running.is_empty() {
                return None;
            }
            state = self.changed.wait(state).expect("no slot panicked");
        }
    }

    /// A job waits again, until nothing runs beside it.
    fn put_back(&self, slot: usize, job: Job) {
        let mut state = self.lock();
        state.running.remove(&slot);
        state.waiting.put_back(Job { peak_bytes: ALONE, ..job });
        self.changed.notify_all();
    }

    fn put(&self, slot: usize, report: JobReport) {
        let mut state = self.lock();
        state.running.remove(&slot);
        if report.end == JobEnd::Done {
            state.waiting.is_there(&report.job.id);
        } else {
            let orphans = state.waiting.is_lost(&report.job.id);
            state.report(orphans, &orphaned(&report));
        }
        state.reports.push(report);
        self.changed.notify_all();
    }

    fn tries(&self, job: &JobId) -> usize {
        self.lock().tries.get(job).copied().unwrap_or(0)
    }

    fn has_tried(&self, job: &JobId) {
        *self.lock().tries.entry(job.clone()).or_default() += 1;
    }
}

/// How a job ends whose need ended so.
fn orphaned(need: &JobReport) -> JobEnd {
    match &need.end {
        JobEnd::Failed(failure) | JobEnd::Crashed(failure) => {
            let sentence = format!("{} did not finish", need.job.label);
            JobEnd::Failed(Failure::new(failure.kind, sentence))
        }
        _ => JobEnd::Stopped,
    }
}

impl State {
    /// The most urgent job that is ready and whose memory is left; with nothing at work, any.
    fn take(&mut self, memory_bytes: u64) -> Option<Job> {
        let used = self.running.values().fold(0, |sum: u64, peak| sum.saturating_add(*peak));
        let alone = self.running.is_empty();
        self.waiting.take(|job| alone || used.saturating_add(job.peak_bytes) <= memory_bytes)
    }

    fn report(&mut self, jobs: Vec<Job>, end: &JobEnd) {
        self.reports.extend(jobs.into_iter().map(|job| JobReport { job, end: end.clone() }));
    }
}

#[cfg(test)]
mod tests;
