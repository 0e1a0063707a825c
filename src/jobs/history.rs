//! The measured speed of a folder's jobs: [`known`].

use std::collections::{BTreeMap, HashMap, HashSet};
use std::fs;

use serde::{Deserialize, Serialize};

use super::folder::{JobState, ResultsFolder};
use super::graph::inputs;
use super::job::{Job, JobId};
use super::speed::{Rate, Speed};
use crate::files::{FileError, atomic, read_if_there};
use crate::plan::{Plan, PlannedRun};
use crate::record::{RunRecord, flops_per_second};
use crate::sweep::Stage;

/// The file of job times.
pub const SCHEDULE: &str = "schedule.jsonl";
/// The file of a sweep's speed, timed before its first run.
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

/// Most records that are read: enough to estimate the speed.
const SAMPLE: usize = 200;

impl Finished {
    /// The finished work of a plan, without damaged records.
    pub fn of(plan: &Plan, folder: &ResultsFolder) -> Self {
        let states = folder.run_states();
        let done = |run: &&PlannedRun| states.of(&run.run_id) == JobState::Done;
        let done = plan.runs.iter().filter(done);
        let done: Vec<_> = done.map(|run| (run.params.total(), run.run_id.as_str())).collect();
        Self::read(folder, &done, &inputs(plan)).0
    }

    /// The finished work of runs with given parameters and ids, and the cost of the other jobs among these; and problems
    /// of records. The records read are spread over all.
    pub fn read(
        folder: &ResultsFolder,
        done: &[(usize, &str)],
        jobs: &[Job],
    ) -> (Self, Vec<String>) {
        let (mut runs, mut problems) = (Vec::new(), Vec::new());
        for (params, id) in done.iter().step_by(done.len().div_ceil(SAMPLE).max(1)) {
            match folder.record(id) {
                Ok(record) => runs.extend(record.map(|record| (*params, record))),
                Err(error) => problems.push(error.to_string()),
            }
        }
        // Those that train no generator.
        let other = jobs.iter().filter(|job| job.id.kind.stage() != Stage::Train);
        let inputs = other.map(|job| (job.id.clone(), job.cost)).collect();
        (Self { runs, inputs }, problems)
    }
}

/// The speed of a folder's jobs: timed before the first run and corrected by finished jobs; otherwise from finished
/// jobs alone. `None` if the speed of runs is unknown.
pub fn known(folder: &ResultsFolder, finished: &Finished) -> Option<Speed> {
    let runs = rates(finished.runs.iter().cloned());
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

/// The rate of finished runs of each size.
pub fn rates(runs: impl IntoIterator<Item = (usize, RunRecord)>) -> Vec<Rate> {
    let mut by_size: BTreeMap<usize, Vec<RunRecord>> = BTreeMap::new();
    for (params, record) in runs {
        by_size.entry(params).or_default().push(record);
    }
    let rate = |(params, records)| Some((params as f64, flops_per_second(records)?));
    by_size.into_iter().filter_map(rate).collect()
}

/// A line of the schedule: one start of a job and its end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stretch {
    /// Counts the schedulers that have written to the file, from 0.
    pub session: usize,
    #[serde(flatten)]
    pub id: JobId,
    pub label: String,
    pub slot: usize,
    /// Seconds since this scheduler began.
    pub start_s: f64,
    pub end_s: f64,
    /// Seconds in training steps.
    pub train_s: f64,
    /// `done`, `stopped`, or the kind of the failure.
    pub end: String,
}

/// FLOPs of their cost that finished jobs other than runs did a second; a job that was interrupted took all of
/// its stretches together.
fn rate_of_inputs(folder: &ResultsFolder, costs: &HashMap<JobId, f64>) -> Option<f64> {
    let text = fs::read_to_string(folder.file(SCHEDULE)).ok()?;
    let stretches = text.lines().filter_map(|line| serde_json::from_str::<Stretch>(line).ok());
    let (mut seconds, mut done) = (HashMap::new(), HashSet::new());
    for Stretch { id, start_s, end_s, end, .. } in
        stretches.filter(|one| costs.contains_key(&one.id))
    {
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
        let tokenizer = JobId::new(JobKind::Tokenizer, "a");
        let finished = |runs| Finished { runs, inputs: [(tokenizer.clone(), 8e10)].into() };
        assert_eq!(known(&folder, &finished(Vec::new())), None);
        let probed = Speed::new(vec![(1e4, 1e9), (1e6, 4e9)], 4e9);
        note(&folder, &probed).unwrap();
        assert_eq!(known(&folder, &finished(Vec::new())), Some(probed.clone()));
        // Stopped once: 40 s in all, where the probe would have it take 20.
        let line = |start: f64, end: f64, how: &str| {
            format!(
                r#"{{"session": 0, "kind": "tokenizer", "id": "a", "label": "", "slot": 0, "start_s": {start}, "end_s": {end}, "train_s": 0, "end": "{how}"}}"#
            )
        };
        let lines = [line(0.0, 10.0, "stopped"), line(10.0, 40.0, "done")];
        fs::write(folder.file(SCHEDULE), lines.join("\n")).unwrap();
        let found = known(&folder, &finished(Vec::new())).unwrap();
        assert_eq!(found.seconds(8e10, None), 40.0);
        assert_eq!(found.seconds(1e9, Some(100)), 1.0, "runs were not looked at yet");
    }
}
