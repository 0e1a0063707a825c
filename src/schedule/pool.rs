//! Slots that take the next ready job until none is left.

use std::collections::HashSet;
use std::sync::{Condvar, Mutex, MutexGuard};

use super::executor::{Executor, JobEnd};
use super::job::{Job, JobKind};
use super::progress::Display;
use super::signals::Stop;

/// Times that a job whose process died is started again.
const RETRIES: usize = 2;

/// How one job of the pool ended.
#[derive(Clone, Debug, PartialEq)]
pub struct JobReport {
    pub job: Job,
    pub end: JobEnd,
}

/// Does all jobs on `slots` threads, in order but for those that wait; returns how each ended.
///
/// A job whose tokenizer failed is not started and is reported as failed with that reason. Jobs not
/// started because of a stop are reported as stopped. With `fail_fast` the first failure stops all.
pub fn run_all(
    jobs: Vec<Job>,
    slots: usize,
    executor: &dyn Executor,
    stop: &Stop,
    fail_fast: bool,
    display: &Display,
) -> Vec<JobReport> {
    let pool = Pool {
        state: Mutex::new(State { waiting: jobs, ..State::default() }),
        changed: Condvar::new(),
    };
    std::thread::scope(|scope| {
        for slot in 0..slots.max(1) {
            let pool = &pool;
            scope.spawn(move || {
                while let Some(job) = pool.take(stop) {
                    let end = attempt(&job, slot, executor, stop, display);
                    if fail_fast && matches!(end, JobEnd::Failed(_) | JobEnd::Crashed(_)) {
                        stop.raise();
                    }
                    display.ended(slot, &job, &end);
                    pool.put(JobReport { job, end });
                }
                display.idle(slot);
            });
        }
    });
    pool.state.into_inner().expect("no slot panicked").reports
}

/// Starts a job, and again where its process died.
fn attempt(
    job: &Job,
    slot: usize,
    executor: &dyn Executor,
    stop: &Stop,
    display: &Display,
) -> JobEnd {
    let mut tries = 0;
    loop {
        display.started(slot, job);
        let end = executor.execute(job, stop, &mut |beat| display.beat(slot, job, &beat));
        match end {
            JobEnd::Crashed(reason) if tries < RETRIES && !stop.is_raised() => {
                tries += 1;
                display.warn(&format!("{}: {reason}; starting it again", job.label));
            }
            // A stop may reach a worker before it listens for one.
            JobEnd::Crashed(_) if stop.is_raised() => return JobEnd::Stopped,
            end => return end,
        }
    }
}

#[derive(Default)]
struct State {
    waiting: Vec<Job>,
    running: usize,
    reports: Vec<JobReport>,
    /// Tokenizers that are there, and those that will not be.
    ready: HashSet<String>,
    lost: HashSet<String>,
}

struct Pool {
    state: Mutex<State>,
    changed: Condvar,
}

impl Pool {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().expect("no slot panicked")
    }

    /// The next job that can start; waits for one; `None` when all is done or a stop was asked for.
    fn take(&self, stop: &Stop) -> Option<Job> {
        let mut state = self.lock();
        loop {
            state.give_up_orphans();
            if stop.is_raised() {
                state.stop_waiting();
            }
            if let Some(index) = state.waiting.iter().position(|job| state.can_start(job)) {
                state.running += 1;
                return Some(state.waiting.remove(index));
            }
            if state.waiting.is_empty() || state.running == 0 {
                return None;
            }
            state = self.changed.wait(state).expect("no slot panicked");
        }
    }

    fn put(&self, report: JobReport) {
        let mut state = self.lock();
        state.running -= 1;
        if let JobKind::Tokenizer(id) = &report.job.kind {
            let known = if report.end == JobEnd::Done { &mut state.ready } else { &mut state.lost };
            known.insert(id.clone());
        }
        state.reports.push(report);
        self.changed.notify_all();
    }
}

impl State {
    fn can_start(&self, job: &Job) -> bool {
        job.waits_for.as_ref().is_none_or(|id| self.ready.contains(id))
    }

    /// Reports the jobs whose tokenizer will not come.
    fn give_up_orphans(&mut self) {
        let lost = &self.lost;
        let orphan = |job: &mut Job| job.waits_for.as_ref().is_some_and(|id| lost.contains(id));
        let orphans: Vec<Job> = self.waiting.extract_if(.., orphan).collect();
        self.reports.extend(orphans.into_iter().map(|job| JobReport {
            job,
            end: JobEnd::Failed("its tokenizer did not finish".to_string()),
        }));
    }

    fn stop_waiting(&mut self) {
        let stopped = self.waiting.drain(..).map(|job| JobReport { job, end: JobEnd::Stopped });
        self.reports.extend(stopped);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::schedule::worker::Beat;

    /// Ends each job as its label says, and notes the order.
    #[derive(Default)]
    struct Mock {
        order: Mutex<Vec<String>>,
    }

    impl Executor for Mock {
        fn execute(&self, job: &Job, _: &Stop, _: &mut dyn FnMut(Beat)) -> JobEnd {
            let mut order = self.order.lock().unwrap();
            order.push(job.kind.id().to_string());
            let tries = order.iter().filter(|id| *id == job.kind.id()).count();
            match job.label.as_str() {
                "fails" => JobEnd::Failed("diverged".into()),
                "crashes" => JobEnd::Crashed("signal 9".into()),
                "crashes once" if tries == 1 => JobEnd::Crashed("signal 9".into()),
                _ => JobEnd::Done,
            }
        }
    }

    fn tokenizer(id: &str, label: &str) -> Job {
        let kind = JobKind::Tokenizer(id.into());
        Job { kind, label: label.into(), cost: 1.0, waits_for: None }
    }

    fn run(id: &str, label: &str, waits_for: Option<&str>) -> Job {
        let waits_for = waits_for.map(String::from);
        Job { kind: JobKind::Run(id.into()), label: label.into(), cost: 1.0, waits_for }
    }

    fn go(jobs: Vec<Job>, slots: usize, fail_fast: bool) -> (Vec<String>, Vec<JobReport>) {
        let mock = Mock::default();
        let stop = Stop::default();
        let reports = run_all(jobs, slots, &mock, &stop, fail_fast, &Display::hidden());
        (mock.order.into_inner().unwrap(), reports)
    }

    fn end(reports: &[JobReport], id: &str) -> JobEnd {
        reports.iter().find(|report| report.job.kind.id() == id).unwrap().end.clone()
    }

    #[test]
    fn runs_wait_for_their_tokenizer() {
        for slots in [1, 4] {
            let jobs = vec![run("a", "", Some("t")), run("b", "", Some("t")), tokenizer("t", "")];
            let (order, reports) = go(jobs, slots, false);
            assert_eq!(order[0], "t");
            assert_eq!(reports.len(), 3);
        }
    }

    #[test]
    fn a_failed_run_does_not_stop_the_others_and_a_failed_tokenizer_ends_its_runs() {
        let jobs = vec![
            tokenizer("t", "fails"),
            run("a", "", Some("t")),
            run("b", "fails", None),
            run("c", "", None),
        ];
        let (order, reports) = go(jobs, 2, false);
        assert!(!order.contains(&"a".to_string()));
        assert_eq!(end(&reports, "a"), JobEnd::Failed("its tokenizer did not finish".into()));
        assert_eq!(end(&reports, "b"), JobEnd::Failed("diverged".into()));
        assert_eq!(end(&reports, "c"), JobEnd::Done);
    }

    #[test]
    fn a_killed_worker_is_started_again_but_not_for_ever() {
        let (order, reports) = go(vec![run("a", "crashes once", None)], 1, false);
        assert_eq!((order.len(), end(&reports, "a")), (2, JobEnd::Done));
        let (order, reports) = go(vec![run("a", "crashes", None)], 1, false);
        assert_eq!((order.len(), end(&reports, "a")), (3, JobEnd::Crashed("signal 9".into())));
    }

    #[test]
    fn fail_fast_leaves_the_rest_for_another_time() {
        let (_, reports) = go(vec![run("a", "fails", None), run("b", "", None)], 1, true);
        assert_eq!(end(&reports, "b"), JobEnd::Stopped);
    }
}
