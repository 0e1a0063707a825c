//! Order, retries, memory and stops of a pool, with a mock runner.

use super::{Waiting, *};
use crate::data::DataFacts;
use crate::failure::FailureKind;
use crate::jobs::{Job, JobId, JobKind, ResultsFolder, missing_jobs};
use crate::plan::{Plan, demand};
use crate::progress::Beat;
use crate::{data, sweep};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::collections::HashMap;
use std::path::Path;

fn kind(word: &str) -> JobKind {
    word.parse().expect("a kind of job")
}

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

fn hidden() -> Display {
    Display::new(&[], 1, true, || None)
}

fn diverged() -> Failure {
    Failure::new(FailureKind::Diverged, "the loss is NaN")
}

fn killed() -> Failure {
    Failure::new(FailureKind::Killed, "signal 9")
}

fn go(jobs: Vec<Job>, slots: usize, fail_fast: bool) -> (Vec<String>, Vec<JobReport>) {
    let (runner, stop, display) = (Mock::default(), Stop::default(), hidden());
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

/// Jobs that use memory; a job is refused it if the total is exceeded.
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

/// A job's real memory is in its label.
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
    let (stop, display) = (Stop::default(), hidden());
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
        // A job larger than the machine ran alone, and was refused each time.
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

/// Every job of a sweep of this repository, in the order of the scheduler.
fn jobs(file: &str, settings: &[&str]) -> Vec<Job> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
    let settings: Vec<String> = settings.iter().map(|one| one.to_string()).collect();
    let sweep = sweep::read(&path, &settings).unwrap();
    let source = data::open(&sweep.data, demand(&sweep).as_ref()).unwrap();
    let plan = Plan::new(&sweep, DataFacts::of(&*source));
    let nowhere = tempfile::tempdir().unwrap();
    missing_jobs(&plan, &ResultsFolder::new(nowhere.path()))
}

/// The end of the last job if each takes `seconds` and slots take them in the pool's order.
fn makespan(jobs: &[Job], seconds: &HashMap<JobId, f64>, slots: usize) -> f64 {
    let (mut waiting, mut now) = (Waiting::new(jobs.to_vec()), 0.0);
    let mut running: Vec<(f64, JobId)> = Vec::new();
    loop {
        while running.len() < slots
            && let Some(job) = waiting.take(|_| true)
        {
            running.push((now + seconds[&job.id], job.id));
        }
        running.sort_by(|a, b| b.0.total_cmp(&a.0));
        let Some((end, id)) = running.pop() else { return now };
        now = end;
        waiting.is_there(&id);
    }
}

/// No order can be shorter: all work shared out evenly, or the longest chain of needs.
fn bound(jobs: &[Job], seconds: &HashMap<JobId, f64>, slots: usize) -> f64 {
    let work: f64 = jobs.iter().map(|job| seconds[&job.id]).sum();
    let by_id: HashMap<&JobId, &Job> = jobs.iter().map(|job| (&job.id, job)).collect();
    fn chain(job: &Job, by_id: &HashMap<&JobId, &Job>, seconds: &HashMap<JobId, f64>) -> f64 {
        let needs = job.needs.iter().map(|need| chain(by_id[need], by_id, seconds));
        seconds[&job.id] + needs.fold(0.0, f64::max)
    }
    let longest = jobs.iter().map(|job| chain(job, &by_id, seconds)).fold(0.0, f64::max);
    longest.max(work / slots as f64)
}

#[test]
fn the_order_is_within_a_tenth_of_the_shortest_even_where_costs_are_guessed_wrong() {
    let wsd = ["train.schedule.kind=wsd", "train.schedule.share=true"];
    let sweeps = [
        jobs("experiments/quickstart.yaml", &[]),
        jobs("experiments/quickstart.yaml", &wsd),
        jobs("tests/sweeps/mini.yaml", &["seeds=[0, 1, 2, 3]"]),
    ];
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    for jobs in &sweeps {
        for slots in [2, 4] {
            for wrong_by in [1.0, 2.0] {
                let mut guess =
                    || 1.0 + (wrong_by - 1.0) * f64::from(rng.next_u32()) / f64::from(u32::MAX);
                let seconds = jobs.iter().map(|job| (job.id.clone(), job.cost * guess())).collect();
                let (found, least) =
                    (makespan(jobs, &seconds, slots), bound(jobs, &seconds, slots));
                println!("{} jobs, {slots} slots: {:.3}", jobs.len(), found / least);
                assert!(found <= 1.1 * least, "{found} against {least} on {slots} slots");
            }
        }
    }
}
