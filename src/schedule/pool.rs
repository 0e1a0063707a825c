//! [`LocalPool`]: slots of this machine that take the next ready job until none is left.

use std::sync::{Condvar, Mutex, MutexGuard};

use super::executor::{Executor, JobEnd, JobReport, Runner};
use super::job::Job;
use super::progress::Display;
use super::signals::Stop;
use super::waiting::Waiting;

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
}

impl Executor for LocalPool<'_> {
    /// A job whose needs failed is not started and is reported as failed with that reason. Jobs not
    /// started because of a stop are reported as stopped.
    fn execute(&self, jobs: Vec<Job>) -> Vec<JobReport> {
        let state = State { waiting: Waiting::new(jobs), running: 0, reports: Vec::new() };
        let shared = Shared { state: Mutex::new(state), changed: Condvar::new() };
        std::thread::scope(|scope| {
            for slot in 0..self.slots.max(1) {
                let shared = &shared;
                scope.spawn(move || self.serve(slot, shared));
            }
        });
        shared.state.into_inner().expect("no slot panicked").reports
    }
}

impl LocalPool<'_> {
    /// One slot's work, from its first job to the end.
    fn serve(&self, slot: usize, shared: &Shared) {
        while let Some(job) = shared.take(self.stop) {
            let end = self.attempt(&job, slot);
            if self.fail_fast && matches!(end, JobEnd::Failed(_) | JobEnd::Crashed(_)) {
                self.stop.raise();
            }
            self.display.ended(slot, &job, &end);
            shared.put(JobReport { job, end });
        }
        self.display.idle(slot);
    }

    /// Starts a job, and again where its process died.
    fn attempt(&self, job: &Job, slot: usize) -> JobEnd {
        let mut tries = 0;
        loop {
            self.display.started(slot, job);
            let mut beat = |beat| self.display.beat(slot, job, &beat);
            match self.runner.run(job, self.stop, &mut beat) {
                JobEnd::Crashed(reason) if tries < RETRIES && !self.stop.is_raised() => {
                    tries += 1;
                    self.display.warn(&format!("{}: {reason}; starting it again", job.label));
                }
                // A stop may reach a worker before it listens for one.
                JobEnd::Crashed(_) if self.stop.is_raised() => return JobEnd::Stopped,
                end => return end,
            }
        }
    }
}

struct State {
    waiting: Waiting,
    running: usize,
    reports: Vec<JobReport>,
}

struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().expect("no slot panicked")
    }

    /// The next job that can start; waits for one; `None` when all is done or a stop was asked for.
    fn take(&self, stop: &Stop) -> Option<Job> {
        let mut state = self.lock();
        loop {
            if stop.is_raised() {
                let stopped = state.waiting.drain();
                state.report(stopped, &JobEnd::Stopped);
            }
            if let Some(job) = state.waiting.take(|_| true) {
                state.running += 1;
                return Some(job);
            }
            if state.running == 0 {
                return None;
            }
            state = self.changed.wait(state).expect("no slot panicked");
        }
    }

    fn put(&self, report: JobReport) {
        let mut state = self.lock();
        state.running -= 1;
        if report.end == JobEnd::Done {
            state.waiting.is_there(&report.job.id);
        } else {
            let orphans = state.waiting.is_lost(&report.job.id);
            state.report(orphans, &orphaned(&report));
        }
        state.reports.push(report);
        self.changed.notify_all();
    }
}

/// How a job ends whose need ended so.
fn orphaned(need: &JobReport) -> JobEnd {
    match &need.end {
        JobEnd::Stopped => JobEnd::Stopped,
        _ => JobEnd::Failed(format!("{} did not finish", need.job.label)),
    }
}

impl State {
    fn report(&mut self, jobs: Vec<Job>, end: &JobEnd) {
        self.reports.extend(jobs.into_iter().map(|job| JobReport { job, end: end.clone() }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{JobId, JobKind};
    use crate::schedule::worker::Beat;

    /// Ends each job as its label says, and notes the order.
    #[derive(Default)]
    struct Mock {
        order: Mutex<Vec<String>>,
    }

    impl Runner for Mock {
        fn run(&self, job: &Job, _: &Stop, _: &mut dyn FnMut(Beat)) -> JobEnd {
            let mut order = self.order.lock().unwrap();
            order.push(job.id.id.clone());
            let tries = order.iter().filter(|id| **id == job.id.id).count();
            match job.label.as_str() {
                "fails" => JobEnd::Failed("diverged".into()),
                "crashes" => JobEnd::Crashed("signal 9".into()),
                "crashes once" if tries == 1 => JobEnd::Crashed("signal 9".into()),
                _ => JobEnd::Done,
            }
        }
    }

    fn job(id: &str, label: &str, needs: &[&str]) -> Job {
        let needs = needs.iter().map(|id| JobId::run(*id)).collect();
        Job {
            id: JobId::new(JobKind::Run, id),
            label: label.into(),
            cost: 1.0,
            peak_bytes: 0,
            needs,
        }
    }

    fn go(jobs: Vec<Job>, slots: usize, fail_fast: bool) -> (Vec<String>, Vec<JobReport>) {
        let (runner, stop, display) = (Mock::default(), Stop::default(), Display::hidden());
        let pool = LocalPool { runner: &runner, slots, stop: &stop, fail_fast, display: &display };
        let reports = pool.execute(jobs);
        (runner.order.into_inner().unwrap(), reports)
    }

    fn end(reports: &[JobReport], id: &str) -> JobEnd {
        reports.iter().find(|report| report.job.id.id == id).unwrap().end.clone()
    }

    #[test]
    fn a_job_waits_for_all_that_it_needs() {
        for slots in [1, 4] {
            let jobs = vec![
                job("run", "", &["trunk", "text"]),
                job("other", "", &["trunk"]),
                job("trunk", "", &["text"]),
                job("text", "", &[]),
            ];
            let (order, reports) = go(jobs, slots, false);
            assert_eq!(order[..2], ["text", "trunk"]);
            assert_eq!(reports.len(), 4);
        }
    }

    #[test]
    fn what_needs_a_failed_job_fails_with_it_and_nothing_else_does() {
        let jobs = vec![
            job("trunk", "fails", &[]),
            job("longer", "", &["trunk"]),
            job("run", "", &["longer"]),
            job("b", "fails", &[]),
            job("c", "", &[]),
        ];
        let (order, reports) = go(jobs, 2, false);
        assert_eq!(order.len(), 3);
        let orphan = JobEnd::Failed("fails did not finish".into());
        assert_eq!([end(&reports, "longer"), end(&reports, "run")], [orphan.clone(), orphan]);
        assert_eq!(end(&reports, "b"), JobEnd::Failed("diverged".into()));
        assert_eq!(end(&reports, "c"), JobEnd::Done);
    }

    #[test]
    fn a_killed_worker_is_started_again_but_not_for_ever() {
        let (order, reports) = go(vec![job("a", "crashes once", &[])], 1, false);
        assert_eq!((order.len(), end(&reports, "a")), (2, JobEnd::Done));
        let (order, reports) = go(vec![job("a", "crashes", &[])], 1, false);
        assert_eq!((order.len(), end(&reports, "a")), (3, JobEnd::Crashed("signal 9".into())));
    }

    #[test]
    fn fail_fast_leaves_the_rest_for_another_time() {
        let (_, reports) = go(vec![job("a", "fails", &[]), job("b", "", &[])], 1, true);
        assert_eq!(end(&reports, "b"), JobEnd::Stopped);
    }
}
