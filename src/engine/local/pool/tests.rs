//! Order, retries, memory and stops of a pool, by a runner that only pretends.

use super::*;

fn kind(word: &str) -> JobKind {
    word.parse().expect("a kind of job")
}

use crate::failure::FailureKind;
use crate::jobs::JobKind;
use crate::progress::Beat;

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
            "fails" => JobEnd::Failed(diverged()),
            "crashes" => JobEnd::Crashed(killed()),
            "stops" => JobEnd::Stopped,
            "finds the disk full" => JobEnd::Halted(Failure::new(FailureKind::DiskFull, "full")),
            "crashes once" if tries == 1 => JobEnd::Crashed(killed()),
            _ => JobEnd::Done,
        }
    }
}

fn job(id: &str, label: &str, needs: &[&str]) -> Job {
    let needs = needs.iter().map(|id| JobId::run(*id)).collect();
    Job { id: JobId::new(kind("run"), id), label: label.into(), cost: 1.0, peak_bytes: 0, needs }
}

fn pool<'a>(
    runner: &'a dyn Runner,
    slots: usize,
    stop: &'a Stop,
    display: &'a Display,
) -> LocalPool<'a> {
    let (memory_bytes, timeline) = (None, None);
    LocalPool { runner, slots, stop, fail_fast: false, display, memory_bytes, timeline }
}

fn diverged() -> Failure {
    Failure::new(FailureKind::Diverged, "the loss is NaN")
}

fn killed() -> Failure {
    Failure::new(FailureKind::Killed, "signal 9")
}

fn go(jobs: Vec<Job>, slots: usize, fail_fast: bool) -> (Vec<String>, Vec<JobReport>) {
    let (runner, stop, display) = (Mock::default(), Stop::default(), Display::hidden());
    let pool = LocalPool { fail_fast, ..pool(&runner, slots, &stop, &display) };
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
    let orphan = Failure::new(FailureKind::Diverged, "fails did not finish");
    let orphan = JobEnd::Failed(orphan);
    assert_eq!([end(&reports, "longer"), end(&reports, "run")], [orphan.clone(), orphan]);
    assert_eq!(end(&reports, "b"), JobEnd::Failed(diverged()));
    assert_eq!(end(&reports, "c"), JobEnd::Done);
}

#[test]
fn a_killed_worker_is_started_again_but_not_for_ever() {
    let (order, reports) = go(vec![job("a", "crashes once", &[])], 1, false);
    assert_eq!((order.len(), end(&reports, "a")), (2, JobEnd::Done));
    let (order, reports) = go(vec![job("a", "crashes", &[])], 1, false);
    let gave_up = Failure::new(FailureKind::Killed, "signal 9 (3 times)");
    let gave_up = JobEnd::Failed(gave_up);
    assert_eq!((order.len(), end(&reports, "a")), (3, gave_up));
}

#[test]
fn fail_fast_leaves_the_rest_for_another_time() {
    let (_, reports) = go(vec![job("a", "fails", &[]), job("b", "", &[])], 1, true);
    assert_eq!(end(&reports, "b"), JobEnd::Stopped);
}

#[test]
fn a_worker_that_stops_unasked_was_told_to_by_somebody_else_and_is_started_again() {
    let (order, reports) = go(vec![job("a", "stops", &[]), job("b", "", &[])], 1, false);
    assert_eq!(order.len(), 4);
    assert_eq!(end(&reports, "a").failure().unwrap().kind, FailureKind::Killed);
    assert_eq!(end(&reports, "b"), JobEnd::Done);
}

#[test]
fn a_full_disk_stops_all_and_fails_nothing() {
    let jobs = vec![job("a", "finds the disk full", &[]), job("b", "", &[]), job("c", "", &["a"])];
    let (order, reports) = go(jobs, 1, false);
    assert_eq!(order, ["a"]);
    assert!(matches!(end(&reports, "a"), JobEnd::Halted(_)));
    assert_eq!([end(&reports, "b"), end(&reports, "c")], [JobEnd::Stopped, JobEnd::Stopped]);
}

/// Jobs that hold memory; one is refused it where more is held than there is.
struct Machine {
    bytes: u64,
    held: Mutex<HashMap<String, u64>>,
    most: Mutex<u64>,
    starts: Mutex<Vec<(String, usize)>>,
}

impl Machine {
    fn new(bytes: u64) -> Self {
        let (held, most, starts) = Default::default();
        Self { bytes, held, most, starts }
    }
}

/// What a job really takes stands in its label.
impl Runner for Machine {
    fn run(&self, job: &Job, _: &Stop, _: &mut dyn FnMut(Beat)) -> JobEnd {
        let takes: u64 = job.label.parse().unwrap();
        {
            let mut held = self.held.lock().unwrap();
            self.starts.lock().unwrap().push((job.id.id.clone(), held.len()));
            held.insert(job.id.id.clone(), takes);
        }
        std::thread::yield_now();
        let mut held = self.held.lock().unwrap();
        let together: u64 = held.values().sum();
        let mut most = self.most.lock().unwrap();
        *most = together.max(*most);
        held.remove(&job.id.id);
        if together > self.bytes {
            return JobEnd::Crashed(Failure::new(FailureKind::OutOfMemory, "killed for memory"));
        }
        JobEnd::Done
    }
}

fn on(machine: &Machine, jobs: Vec<Job>) -> Vec<JobReport> {
    let (stop, display) = (Stop::default(), Display::hidden());
    let memory_bytes = Some(machine.bytes);
    LocalPool { memory_bytes, ..pool(machine, 4, &stop, &display) }.execute(jobs)
}

fn taking(id: usize, says: u64, takes: u64) -> Job {
    Job { peak_bytes: says, ..job(&id.to_string(), &takes.to_string(), &[]) }
}

#[test]
fn no_more_is_started_than_memory_allows_but_always_one() {
    for round in 0..50 {
        let machine = Machine::new(10);
        let sizes = [7, 4, 4, 3, 2, 9, 1, 1, 1, 25];
        let jobs = (0..sizes.len()).map(|i| taking(i, sizes[(i + round) % 10], 0));
        let jobs = jobs.map(|job| Job { label: job.peak_bytes.to_string(), ..job }).collect();
        let reports = on(&machine, jobs);
        // What is larger than the machine ran alone, and was refused each time.
        let failed: Vec<u64> = reports
            .iter()
            .filter(|report| report.end != JobEnd::Done)
            .map(|report| report.job.label.parse().unwrap())
            .collect();
        assert_eq!(failed, [25]);
        assert_eq!(*machine.most.lock().unwrap(), 25);
        let starts = machine.starts.into_inner().unwrap();
        let large = reports.iter().find(|report| report.end != JobEnd::Done).unwrap();
        let beside = starts.iter().filter(|(id, _)| *id == large.job.id.id).map(|(_, n)| *n);
        assert_eq!(beside.collect::<Vec<_>>(), [0, 0, 0]);
    }
}

#[test]
fn what_was_killed_for_memory_runs_again_with_nothing_beside_it() {
    for _ in 0..50 {
        let machine = Machine::new(10);
        // Each says that it takes 1, and takes 8.
        let reports = on(&machine, (0..6).map(|i| taking(i, 1, 8)).collect());
        assert!(reports.iter().all(|report| report.end == JobEnd::Done), "{reports:?}");
        let starts = machine.starts.into_inner().unwrap();
        let mut seen = std::collections::HashSet::new();
        for (id, beside) in starts {
            assert!(seen.insert(id) || beside == 0);
        }
    }
}

#[test]
fn a_large_job_is_not_passed_over_for_ever() {
    let machine = Machine::new(10);
    let mut jobs = vec![taking(1000, 6, 6), taking(1001, 8, 8)];
    jobs.extend((0..100).map(|i| taking(i, 2, 2)));
    on(&machine, jobs);
    let starts = machine.starts.into_inner().unwrap();
    let place = starts.iter().position(|(id, _)| id == "1001").unwrap();
    assert!(place < 60, "started after {place} others");
}
