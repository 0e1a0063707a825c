//! How close the order of jobs comes to the shortest time that any order could take.

use std::path::Path;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::Waiting;
use crate::data::{self, DataFacts};
use crate::jobs::{Job, JobId, ResultsFolder, missing_jobs};
use crate::plan::{Plan, demand};
use crate::sweep;
use std::collections::HashMap;

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

/// The end of the last job where each takes `seconds` and slots take them up as a pool does.
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
