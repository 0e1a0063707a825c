//! [`LocalPool`]: slots that take the next ready job until none is left.

use super::display::Display;
use super::traces::Timeline;
use crate::engine::runner::{JobEnd, JobReport, Runner};
use crate::failure::{Failure, FailureKind};
use crate::jobs::{Job, JobId};
use crate::progress::{Beat, Stop};
use std::collections::{BTreeSet, HashMap};
use std::sync::{Condvar, Mutex, MutexGuard};

/// Times that a job whose process died is started again.
const RETRIES: usize = 2;

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
    /// The record of job times.
    pub timeline: Option<&'a Timeline>,
}

impl LocalPool<'_> {
    /// Runs jobs, each after its dependencies; returns the end of each.
    ///
    /// A job with a failed dependency is not started, and reported as failed for that reason. Jobs not started because of
    /// a stop are reported as stopped. A slot without a thread from the system stays empty.
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

    /// Runs a job, retrying if its process dies. `None` if it must be retried with nothing else running.
    fn attempt(&self, job: &Job, slot: usize, shared: &Shared) -> Option<JobEnd> {
        loop {
            let end = self.once(job, slot);
            let failure = match end {
                // A stop may reach a worker before it listens for one.
                JobEnd::Crashed(_) if self.stop.is_raised() => return Some(JobEnd::Stopped),
                JobEnd::Crashed(failure) => failure,
                JobEnd::Stopped if !self.stop.is_raised() => {
                    let sentence = "the worker was told to stop, and not by its scheduler";
                    Failure::new(FailureKind::Killed, sentence)
                }
                end => return Some(end),
            };
            let sentence = failure.reason.clone();
            // It may have taken more memory than there was.
            let is_large = failure.kind == FailureKind::OutOfMemory;
            if shared.count_try(&job.id) > RETRIES {
                return Some(self.give_up(job, failure));
            }
            let what = match is_large {
                true => "it is started again when nothing runs beside it",
                false => "starting it again",
            };
            self.display.warn(&format!("{}: {sentence}; {what}", job.label));
            if is_large {
                return None;
            }
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

    /// A job that died too often has failed, unless the failure cannot be written.
    fn give_up(&self, job: &Job, Failure { kind, reason, last_lines }: Failure) -> JobEnd {
        let how = match kind {
            FailureKind::OutOfMemory => "; nothing ran beside it the last time",
            _ => "",
        };
        let reason = format!("{reason} ({} times{how})", RETRIES + 1);
        let noted = self.runner.give_up(job, Failure { kind, reason, last_lines });
        if noted.kind == kind { JobEnd::Failed(noted) } else { JobEnd::of(noted) }
    }
}

/// The memory counted for a job that must run alone.
const ALONE: u64 = u64::MAX;

struct State {
    waiting: Waiting,
    /// Peak bytes of the job of each slot that is at work.
    running: HashMap<usize, u64>,
    /// Times that a job was started.
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
            // The most urgent that is ready and whose memory is left; with nothing at work, any.
            let State { waiting, running, .. } = &mut *state;
            let used = running.values().fold(0, |sum: u64, peak| sum.saturating_add(*peak));
            let fits = |job: &Job| used.saturating_add(job.peak_bytes) <= self.memory_bytes;
            if let Some(job) = waiting.take(|job| running.is_empty() || fits(job)) {
                state.running.insert(slot, job.peak_bytes);
                return Some(job);
            }
            if state.running.is_empty() {
                return None;
            }
            state = self.changed.wait(state).expect("no slot panicked");
        }
    }

    /// Puts a job back until nothing else runs.
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

    /// The number of tries of a job, this one included.
    fn count_try(&self, job: &JobId) -> usize {
        let mut state = self.lock();
        let tries = state.tries.entry(job.clone()).or_default();
        *tries += 1;
        *tries
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
    fn report(&mut self, jobs: Vec<Job>, end: &JobEnd) {
        self.reports.extend(jobs.into_iter().map(|job| JobReport { job, end: end.clone() }));
    }
}

#[cfg(test)]
mod tests;

// [`Waiting`]: jobs that nobody has begun, and which of them could be.

/// Jobs in their order of urgency, each ready once all that it needs is there.
#[derive(Debug, Default)]
pub struct Waiting {
    jobs: Vec<Option<Job>>,
    /// The number of open dependencies of each.
    open: Vec<usize>,
    needed_by: HashMap<JobId, Vec<usize>>,
    ready: BTreeSet<usize>,
    /// The number of jobs that overtook each.
    passed: Vec<usize>,
}

/// Others that are let past a job for which there is not enough memory yet.
const MOST_PASSED: usize = 16;

impl Waiting {
    /// Jobs, the most urgent first; what one needs must be among them.
    pub fn new(jobs: Vec<Job>) -> Self {
        let mut needed_by: HashMap<JobId, Vec<usize>> = HashMap::new();
        for (index, job) in jobs.iter().enumerate() {
            for need in &job.needs {
                needed_by.entry(need.clone()).or_default().push(index);
            }
        }
        let open: Vec<usize> = jobs.iter().map(|job| job.needs.len()).collect();
        let ready = (0..jobs.len()).filter(|&index| open[index] == 0).collect();
        let passed = vec![0; jobs.len()];
        Self { jobs: jobs.into_iter().map(Some).collect(), open, needed_by, ready, passed }
    }

    /// Takes the most urgent job that is ready and that `fits`. What fits is let past one that does
    /// not, but not for ever.
    pub fn take(&mut self, fits: impl Fn(&Job) -> bool) -> Option<Job> {
        let index = self.first_fit(&fits)?;
        for passed in self.ready.range(..index) {
            self.passed[*passed] += 1;
        }
        self.ready.remove(&index);
        self.jobs[index].take()
    }

    fn first_fit(&self, fits: impl Fn(&Job) -> bool) -> Option<usize> {
        for &index in &self.ready {
            if self.jobs[index].as_ref().is_some_and(&fits) {
                return Some(index);
            }
            if self.passed[index] >= MOST_PASSED {
                return None;
            }
        }
        None
    }

    /// Puts a job back that was taken, behind all others.
    pub fn put_back(&mut self, job: Job) {
        self.ready.insert(self.jobs.len());
        self.jobs.push(Some(job));
        self.open.push(0);
        self.passed.push(0);
    }

    /// Marks a job as done for its dependents.
    pub fn is_there(&mut self, id: &JobId) {
        for index in self.needed_by.remove(id).unwrap_or_default() {
            self.open[index] -= 1;
            if self.open[index] == 0 {
                self.ready.insert(index);
            }
        }
    }

    /// Takes out all that needs, at any remove, a job that will not come.
    pub fn is_lost(&mut self, id: &JobId) -> Vec<Job> {
        let orphans = self.needed_by.remove(id).unwrap_or_default();
        let orphans: Vec<Job> = orphans.into_iter().filter_map(|i| self.jobs[i].take()).collect();
        let further: Vec<Job> = orphans.iter().flat_map(|job| self.is_lost(&job.id)).collect();
        orphans.into_iter().chain(further).collect()
    }

    /// Takes out all that is left.
    pub fn drain(&mut self) -> Vec<Job> {
        self.ready.clear();
        self.jobs.iter_mut().filter_map(Option::take).collect()
    }
}
