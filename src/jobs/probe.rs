//! How fast this machine is: a few real training steps.

use std::collections::HashSet;
use std::time::{Duration, Instant};

use burn::tensor::Device;

use super::job::Job;
use super::speed::{Rate, Speed};
use crate::generator::{self, MOST_PROBED_PARAMS};
use crate::plan::{Plan, PlannedRun};

/// Models of a plan that are measured at most, from the smallest to the largest.
const PROBES: usize = 4;
const PROBE_TIME: Duration = Duration::from_millis(300);

/// The speed of training steps of these runs, measured now, side by side on as many cores as workers will have.
/// `probes` sizes are measured at most, two at least, from the smallest to the largest. Jobs that train no generator
/// go at the best rate of all.
pub fn speed(runs: &[&PlannedRun], device: &Device, slots: usize, probes: usize) -> Speed {
    let rates = side_by_side(slots, || measure(runs, device, probes.max(2)));
    let best = rates.iter().map(|(_, rate)| *rate).fold(f64::MIN_POSITIVE, f64::max);
    Speed::new(rates, best)
}

/// The same, for the runs of a plan that are among these jobs.
pub fn speed_of(jobs: &[Job], plan: &Plan, device: &Device, slots: usize) -> Speed {
    let wanted: HashSet<&str> = jobs.iter().map(|job| job.id.id.as_str()).collect();
    let missing = |run: &&PlannedRun| wanted.contains(run.run_id.as_str());
    speed(&plan.runs.iter().filter(missing).collect::<Vec<_>>(), device, slots, PROBES)
}

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
