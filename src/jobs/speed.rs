//! [`Speed`]: the speed of jobs, by timing a few training steps or from elsewhere, and the estimated time of all. Every
//! estimate of time is made here.

use super::folder::{JobState, ResultsFolder};
use super::graph::inputs;
use super::job::{Job, JobId};
use crate::files::{FileError, atomic, read_if_there};
use crate::generator::{self, MOST_PROBED_PARAMS};
use crate::plan::{Plan, PlannedRun};
use crate::record::{RunRecord, flops_per_second as measured};
use crate::sweep::Stage;
use burn::tensor::Device;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap, HashSet};
use std::fs;
use std::time::{Duration, Instant};

/// Parameters of a generator, and FLOPs a second.
pub type Rate = (f64, f64);

/// FLOPs per second of jobs, each on its own slot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Speed {
    /// Rates of runs and trunks by the size of their generator, ascending.
    runs: Vec<Rate>,
    /// The rate of all other jobs.
    inputs: f64,
}

impl Speed {
    /// Rates of runs, ascending by size, and of all other jobs.
    pub fn new(runs: Vec<Rate>, inputs: f64) -> Self {
        Self { runs, inputs }
    }

    /// That of training steps of these runs, measured now, side by side on as many cores as workers will have.
    /// `probes` sizes are measured at most, two at least, from the smallest to the largest. Jobs that train no
    /// generator go at the best rate of all.
    pub fn measured(runs: &[&PlannedRun], device: &Device, slots: usize, probes: usize) -> Self {
        let rates = side_by_side(slots, || measure(runs, device, probes.max(2)));
        let best = rates.iter().map(|(_, rate)| *rate).fold(f64::MIN_POSITIVE, f64::max);
        Self::new(rates, best)
    }

    /// The same, for the runs of a plan that are among these jobs.
    pub fn measured_of(jobs: &[Job], plan: &Plan, device: &Device, slots: usize) -> Self {
        let wanted: HashSet<&str> = jobs.iter().map(|job| job.id.id.as_str()).collect();
        let missing = |run: &&PlannedRun| wanted.contains(run.run_id.as_str());
        let runs: Vec<&PlannedRun> = plan.runs.iter().filter(missing).collect();
        Self::measured(&runs, device, slots, PROBES)
    }

    /// Corrects the speed by finished work: runs, given by parameters, FLOPs and seconds, were slower by some factor, which
    /// is applied to others; other jobs get their own rate.
    pub fn borne_out_by(&self, runs: &[(usize, f64, f64)], inputs: Option<f64>) -> Self {
        let expected: f64 = runs.iter().map(|run| self.seconds(run.1, Some(run.0))).sum();
        let took: f64 = runs.iter().map(|run| run.2).sum();
        let factor = if took > 0.0 { expected / took } else { 1.0 };
        let runs = self.runs.iter().map(|(params, rate)| (*params, rate * factor)).collect();
        Self { runs, inputs: inputs.unwrap_or(self.inputs) }
    }

    /// Seconds for work of this cost; `params` of the generator, if it trains one.
    pub fn seconds(&self, cost: f64, params: Option<usize>) -> f64 {
        cost / params.map_or(self.inputs, |params| rate_at(&self.runs, params))
    }

    /// Hours that jobs of a plan take on `slots` slots side by side.
    pub fn hours(&self, jobs: &[Job], plan: &Plan, slots: usize) -> f64 {
        let params = params(plan);
        let seconds = |job: &Job| self.seconds(job.cost, params.get(job.id.id.as_str()).copied());
        seconds_left(jobs.iter().map(seconds), slots) / 3600.0
    }
}

/// Seconds until jobs that take so many seconds each are done on `slots` slots: as long as the longest of them,
/// at least.
pub fn seconds_left(jobs: impl Iterator<Item = f64>, slots: usize) -> f64 {
    let (sum, longest) = jobs.fold((0.0, 0.0_f64), |(sum, most), s| (sum + s, most.max(s)));
    (sum / slots.max(1) as f64).max(longest)
}

/// Parameters of the generator that each run and each trunk trains, by id; no other job has one of
/// these ids.
pub fn params(plan: &Plan) -> HashMap<&str, usize> {
    let runs = plan.runs.iter().map(|run| (run.run_id.as_str(), run.params.total()));
    let trunks = plan.trunks.iter();
    let trunks = trunks.map(|trunk| (trunk.trunk_id.as_str(), trunk.spec.params().total()));
    runs.chain(trunks).collect()
}

/// Between known sizes linear in logarithms; outside, as the nearest.
pub fn rate_at(rates: &[Rate], params: usize) -> f64 {
    let x = (params as f64).ln();
    let above = rates.partition_point(|(n, _)| n.ln() < x);
    match (above.checked_sub(1).map(|i| rates[i]), rates.get(above).copied()) {
        (Some((n0, r0)), Some((n1, r1))) => {
            let share = (x - n0.ln()) / (n1.ln() - n0.ln());
            (r0.ln() * (1.0 - share) + r1.ln() * share).exp()
        }
        (Some((_, rate)), None) | (None, Some((_, rate))) => rate,
        (None, None) => f64::INFINITY,
    }
}

// Measuring.

/// Models of a plan that are measured at most, from the smallest to the largest.
const PROBES: usize = 4;
const PROBE_TIME: Duration = Duration::from_millis(300);

/// Times as many threads as `slots` workers can have a core each; the mean of each rate. Workers share memory and
/// caches, so one alone would be faster.
fn side_by_side(slots: usize, measure: impl Fn() -> Vec<Rate> + Sync) -> Vec<Rate> {
    let n_threads = slots.clamp(1, std::thread::available_parallelism().map_or(1, usize::from));
    let measured: Vec<Vec<Rate>> = std::thread::scope(|scope| {
        let started: Vec<_> =
            (0..n_threads).map(|_| scope.spawn(|| on_one_thread(&measure))).collect();
        started.into_iter().filter_map(|thread| thread.join().ok()).collect()
    });
    let Some(first) = measured.first() else { return Vec::new() };
    let mean = |(i, (params, _)): (usize, &Rate)| {
        let rates = measured.iter().filter_map(|rates| rates.get(i)).map(|(_, rate)| rate);
        (*params, rates.sum::<f64>() / measured.len() as f64)
    };
    first.iter().enumerate().map(mean).collect()
}

/// Workers have one thread each, so timing uses one.
fn on_one_thread<T: Send>(measure: impl Fn() -> T + Send) -> T {
    match rayon::ThreadPoolBuilder::new().num_threads(1).build() {
        Ok(pool) => pool.install(measure),
        Err(_) => measure(),
    }
}

/// Parameters and budget FLOPs a second of each probed run, by size.
fn measure(runs: &[&PlannedRun], device: &Device, probes: usize) -> Vec<Rate> {
    let mut sizes: Vec<_> = runs.iter().collect();
    sizes.sort_by_key(|run| run.params.total());
    sizes.dedup_by_key(|run| run.params.total().min(MOST_PROBED_PARAMS));
    let last = sizes.len().saturating_sub(1);
    let mut picked: Vec<usize> = (0..probes).map(|i| i * last / (probes - 1)).collect();
    picked.dedup();
    let rate = |run: &PlannedRun| (run.params.total() as f64, flops_per_second(run, device));
    picked.into_iter().filter_map(|i| sizes.get(i)).map(|run| rate(run)).collect()
}

/// Budget FLOPs a second of a run's training step, the median of as many as fit the time; 0 if the
/// device makes no step.
fn flops_per_second(run: &PlannedRun, device: &Device) -> f64 {
    let mut probe = generator::of(&run.spec).probe(&run.spec, device);
    let (started, mut seconds) = (Instant::now(), Vec::new());
    for step in 0.. {
        let at = Instant::now();
        if probe.step().is_err() {
            break;
        }
        if step > 0 {
            seconds.push(at.elapsed().as_secs_f64());
        }
        if step > 0 && started.elapsed() > PROBE_TIME {
            break;
        }
    }
    seconds.sort_by(f64::total_cmp);
    seconds.get(seconds.len() / 2).map_or(0.0, |median| probe.flops() / median)
}

// The measured speed of a folder's jobs.

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
    let rate = |(params, records)| Some((params as f64, measured(records)?));
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

    #[test]
    fn jobs_take_as_long_as_the_longest_and_as_their_sum_on_all_slots() {
        assert_eq!(seconds_left([10.0, 1.0, 1.0].into_iter(), 4), 10.0);
        assert_eq!(seconds_left([4.0; 6].into_iter(), 2), 12.0);
        assert_eq!(seconds_left(std::iter::empty(), 0), 0.0);
    }

    #[test]
    fn runs_go_by_their_size_and_other_jobs_at_a_rate_of_their_own() {
        let speed = Speed::new(vec![(1e4, 1e9), (1e6, 4e9)], 1e10);
        let seconds = |params| speed.seconds(1e10, params);
        assert_eq!(
            [seconds(None), seconds(Some(100)), seconds(Some(10_000_000))],
            [1.0, 10.0, 2.5]
        );
        assert!((seconds(Some(100_000)) - 5.0).abs() < 1e-9);
        // Twice as slow as it was thought to be.
        let slow = speed.borne_out_by(&[(10_000, 1e10, 20.0)], None);
        assert_eq!([slow.seconds(1e10, None), slow.seconds(1e10, Some(10_000_000))], [1.0, 5.0]);
    }
}

#[cfg(test)]
mod history_tests {
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
