//! [`Speed`]: the speed of jobs, by timing a few training steps or from elsewhere, and the estimated time of all. Every
//! estimate of time is made here.

use std::collections::{HashMap, HashSet};
use std::time::{Duration, Instant};

use burn::tensor::Device;
use serde::{Deserialize, Serialize};

use super::job::Job;
use crate::generator::{self, MOST_PROBED_PARAMS};
use crate::plan::{Plan, PlannedRun};

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
