//! How long a plan takes here: a few real training steps, then arithmetic.

use std::collections::{HashMap, HashSet};
use std::time::{Duration, Instant};

use burn::tensor::Device;

use super::job::Job;
use crate::generator::{self, MOST_PROBED_PARAMS};
use crate::plan::{Plan, PlannedRun};

/// Models measured at most, from the smallest to the largest.
const PROBES: usize = 4;
const PROBE_TIME: Duration = Duration::from_millis(300);

/// Hours that jobs take on `slots` slots, by training steps measured now, side by side on as many cores as
/// workers will have. Jobs that train no generator are priced at the best rate measured; runs at `run_rate`, FLOPs a second, where
/// it is given.
pub fn hours(
    jobs: &[Job],
    plan: &Plan,
    device: &Device,
    slots: usize,
    run_rate: Option<f64>,
) -> f64 {
    let wanted: HashSet<&str> = jobs.iter().map(|job| job.id.id.as_str()).collect();
    let missing = |run: &&PlannedRun| wanted.contains(run.run_id.as_str());
    let runs: Vec<&PlannedRun> = plan.runs.iter().filter(missing).collect();
    let params = params(plan);
    let measured =
        run_rate.is_none() || jobs.iter().any(|job| !params.contains_key(job.id.id.as_str()));
    let rates = if measured { side_by_side(slots, || measure(&runs, device)) } else { Vec::new() };
    let best = rates.iter().map(|(_, rate)| *rate).fold(f64::MIN_POSITIVE, f64::max);
    let rate = |job: &Job| match params.get(job.id.id.as_str()) {
        Some(params) => run_rate.unwrap_or_else(|| rate_at(&rates, *params)),
        None => best,
    };
    let seconds: Vec<f64> = jobs.iter().map(|job| job.cost / rate(job)).collect();
    let longest = seconds.iter().copied().fold(0.0, f64::max);
    (seconds.iter().sum::<f64>() / slots as f64).max(longest) / 3600.0
}

/// Parameters of the generator that each run and each trunk trains, by id; no other job has one of
/// these ids.
fn params(plan: &Plan) -> HashMap<&str, usize> {
    let runs = plan.runs.iter().map(|run| (run.run_id.as_str(), run.params.total()));
    let trunks = plan.trunks.iter();
    let trunks = trunks.map(|trunk| (trunk.trunk_id.as_str(), trunk.spec.params().total()));
    runs.chain(trunks).collect()
}

/// Parameters, and budget FLOPs a second.
pub(super) type Rate = (f64, f64);

/// What as many threads measure as `slots` workers can have a core each; the mean of each rate. Workers share
/// memory and caches, and one alone is faster.
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

/// Workers have a thread each, so what they will need is measured on one.
fn on_one_thread<T: Send>(measure: impl Fn() -> T + Send) -> T {
    match rayon::ThreadPoolBuilder::new().num_threads(1).build() {
        Ok(pool) => pool.install(measure),
        Err(_) => measure(),
    }
}

/// Parameters and budget FLOPs a second of each probed run, by size.
fn measure(runs: &[&PlannedRun], device: &Device) -> Vec<Rate> {
    let mut sizes: Vec<_> = runs.iter().collect();
    sizes.sort_by_key(|run| run.params.total());
    sizes.dedup_by_key(|run| run.params.total().min(MOST_PROBED_PARAMS));
    let last = sizes.len().saturating_sub(1);
    let mut picked: Vec<usize> = (0..PROBES).map(|i| i * last / (PROBES - 1)).collect();
    picked.dedup();
    let rate = |run: &PlannedRun| (run.params.total() as f64, flops_per_second(run, device));
    picked.into_iter().filter_map(|i| sizes.get(i)).map(|run| rate(run)).collect()
}

/// Between probes, linear in logarithms; outside, the nearest.
pub(super) fn rate_at(rates: &[Rate], params: usize) -> f64 {
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

/// Budget FLOPs a second of a run's training step, the median of as many as fit the time; 0 where the
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
