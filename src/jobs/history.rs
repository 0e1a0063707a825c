//! How fast the jobs of a folder were: [`known`].

use std::collections::{BTreeMap, HashMap, HashSet};
use std::fs;

use serde::Deserialize;

use super::folder::{JobState, ResultsFolder};
use super::graph::inputs;
use super::id::JobId;
use super::job::Job;
use super::speed::{Rate, Speed};
use crate::files::{FileError, atomic, read_if_there};
use crate::plan::{Plan, PlannedRun};
use crate::record::{RunRecord, flops_per_second};
use crate::sweep::Stage;

/// Where a scheduler writes when each job ran.
pub const SCHEDULE: &str = "schedule.jsonl";
/// Where a sweep's speed is noted that was measured before its first run.
const PROBED: &str = "speed.json";

/// Notes a speed that was measured before there are finished runs.
///
/// # Errors
/// The folder cannot be written to.
pub fn note(folder: &ResultsFolder, speed: &Speed) -> Result<(), FileError> {
    atomic::write_json(&folder.file(PROBED), speed)
}

/// Work that is done: the generator's parameters and the records of the finished runs, and the cost of each other
/// job.
pub struct Finished {
    pub runs: Vec<(usize, RunRecord)>,
    pub inputs: HashMap<JobId, f64>,
}

/// Records that are read: as many tell the speed as well as all.
const SAMPLE: usize = 200;

impl Finished {
    /// What is done of a plan. A damaged record is left out.
    pub fn of(plan: &Plan, folder: &ResultsFolder) -> Self {
        let states = folder.run_states();
        let done = |run: &&PlannedRun| states.of(&run.run_id) == JobState::Done;
        let done: Vec<&PlannedRun> = plan.runs.iter().filter(done).collect();
        let sample = done.iter().step_by(done.len().div_ceil(SAMPLE).max(1));
        let record = |run: &&PlannedRun| folder.record(&run.run_id).ok().flatten();
        let runs = sample.filter_map(|run| Some((run.params.total(), record(run)?)));
        Self { runs: runs.collect(), inputs: costs(&inputs(plan)) }
    }
}

/// The cost of each job that trains no generator.
pub fn costs(inputs: &[Job]) -> HashMap<JobId, f64> {
    let other = inputs.iter().filter(|job| job.id.kind.stage() != Stage::Train);
    other.map(|job| (job.id.clone(), job.cost)).collect()
}

/// The speed of a folder's jobs: that which was measured before, as far as finished jobs bear it out; without
/// one, that of finished jobs. `None` if neither tells how fast runs are.
pub fn known(folder: &ResultsFolder, finished: &Finished) -> Option<Speed> {
    let runs = rates(&finished.runs);
    let inputs = rate_of_inputs(folder, &finished.inputs);
    match read_if_there::<Speed>(&folder.file(PROBED)).ok().flatten() {
        Some(probed) => Some(probed.borne_out_by(&work(&finished.runs), inputs)),
        None if runs.is_empty() => None,
        None => {
            let best = runs.iter().map(|(_, rate)| *rate).fold(f64::MIN_POSITIVE, f64::max);
            Some(Speed::new(runs, inputs.unwrap_or(best)))
        }
    }
}

/// FLOPs and seconds of finished runs, by their parameters.
fn work(runs: &[(usize, RunRecord)]) -> Vec<(usize, f64, f64)> {
    let one = |(params, record): &(usize, RunRecord)| {
        let seconds = record.measured.wall_s.filter(|seconds| *seconds > 0.0)?;
        Some((*params, record.planned.budget_flops, seconds))
    };
    runs.iter().filter_map(one).collect()
}

fn rates(runs: &[(usize, RunRecord)]) -> Vec<Rate> {
    let mut by_size: BTreeMap<usize, Vec<RunRecord>> = BTreeMap::new();
    for (params, record) in runs {
        by_size.entry(*params).or_default().push(record.clone());
    }
    let rate = |(params, records)| Some((params as f64, flops_per_second(records)?));
    by_size.into_iter().filter_map(rate).collect()
}

/// A line of the schedule.
#[derive(Deserialize)]
struct Stretch {
    #[serde(flatten)]
    id: JobId,
    start_s: f64,
    end_s: f64,
    end: String,
}

/// FLOPs of their cost that finished jobs other than runs did a second; a job that was interrupted took all of
/// its stretches together.
fn rate_of_inputs(folder: &ResultsFolder, costs: &HashMap<JobId, f64>) -> Option<f64> {
    let text = fs::read_to_string(folder.file(SCHEDULE)).ok()?;
    let stretches = text.lines().filter_map(|line| serde_json::from_str::<Stretch>(line).ok());
    let (mut seconds, mut done) = (HashMap::new(), HashSet::new());
    for Stretch { id, start_s, end_s, end } in stretches.filter(|one| costs.contains_key(&one.id)) {
        if end == "done" {
            done.insert(id.clone());
        }
        *seconds.entry(id).or_insert(0.0) += end_s - start_s;
    }
    let (flops, seconds) =
        done.iter().fold((0.0, 0.0), |(flops, all), id| (flops + costs[id], all + seconds[id]));
    Some(flops / seconds).filter(|rate| rate.is_finite() && *rate > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::JobKind;

    #[test]
    fn a_speed_that_was_measured_is_borne_out_by_the_jobs_that_are_done() {
        let place = tempfile::tempdir().unwrap();
        let folder = ResultsFolder::new(place.path());
        let tokenizer = JobId::new(JobKind::of("tokenizer").unwrap(), "a");
        let finished = |runs| Finished { runs, inputs: [(tokenizer.clone(), 8e10)].into() };
        assert_eq!(known(&folder, &finished(Vec::new())), None);
        let probed = Speed::new(vec![(1e4, 1e9), (1e6, 4e9)], 4e9);
        note(&folder, &probed).unwrap();
        assert_eq!(known(&folder, &finished(Vec::new())), Some(probed.clone()));
        // Stopped once: 40 s in all, where the probe would have it take 20.
        let line = |start: f64, end: f64, how: &str| {
            format!(
                r#"{{"session": 0, "kind": "tokenizer", "id": "a", "start_s": {start}, "end_s": {end}, "end": "{how}"}}"#
            )
        };
        let lines = [line(0.0, 10.0, "stopped"), line(10.0, 40.0, "done")];
        fs::write(folder.file(SCHEDULE), lines.join("\n")).unwrap();
        let found = known(&folder, &finished(Vec::new())).unwrap();
        assert_eq!(found.seconds(8e10, None), 40.0);
        assert_eq!(found.seconds(1e9, Some(100)), 1.0, "runs were not looked at yet");
    }
}
