//! Arranges the jobs of a plan into arrays of chunks, in order of dependency.

use super::command::Settings;
use super::files::{ChunkFile, Timed};
use crate::files::FileError;
use crate::jobs::gpu::Gpu;
use crate::jobs::speed::Speed;
use crate::jobs::{Job, JobId, JobKind, JobState, ResultsFolder};
use crate::plan::{Plan, PlannedRun};
use crate::record::flops_per_second;
use crate::sweep::Stage;
use burn::tensor::Device;
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// A task that must have succeeded first.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum After {
    /// A task of an array that is submitted before: its place among all arrays, and its index.
    Ours { array: usize, index: usize },
    /// A task that is in the queue already, as `123_4`.
    Queued(String),
}

/// An array of chunks.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Unique in a submission: `inputs`, `train-2`.
    pub name: String,
    pub stage: Stage,
    pub chunks: Vec<ChunkFile>,
    pub after: Vec<After>,
}

impl Array {
    /// The fit, which is a job by itself, after the end of all others.
    pub fn fit() -> Self {
        let (name, stage) = (Stage::Fit.word().to_string(), Stage::Fit);
        Self { name, stage, chunks: Vec::new(), after: Vec::new() }
    }

    /// Number of tasks; `None` for the fit.
    pub fn tasks(&self) -> Option<usize> {
        (self.stage != Stage::Fit).then_some(self.chunks.len())
    }
}

/// The settings of arrays, besides the jobs.
pub struct Layout<'a> {
    pub settings: &'a Settings,
    pub estimates: &'a Estimates,
    /// Everything that a job reads, whether it is there already or not.
    pub reads: &'a dyn Fn(&JobId) -> Vec<JobId>,
    /// The task that does a job, for jobs that are in the queue already.
    pub queued: &'a HashMap<JobId, String>,
    /// Tasks of an array at most.
    pub max_array: usize,
    /// Limit on the tasks of all arrays, met by packing if possible.
    pub max_tasks: usize,
}

/// Jobs that cannot be parted: a tokenizer and its codes, or a trunk and all that branches off it.
#[derive(Clone, Debug, Default)]
struct Unit {
    jobs: Vec<Timed>,
    seconds: f64,
}

/// Arrays in order of submission, without queued jobs.
///
/// Runs are grouped by the jobs that they wait for, one array per group, so that a failed tokenizer delays only its own
/// runs.
pub fn arrays(jobs: &[Job], layout: &Layout) -> Vec<Array> {
    let open: Vec<&Job> = jobs.iter().filter(|job| !layout.queued.contains_key(&job.id)).collect();
    let of = |stage: Stage| {
        let chosen = open.iter().copied().filter(|job| job.id.kind.stage() == stage);
        units(chosen.collect(), layout)
    };
    let alone = |units: Vec<Unit>| units.into_iter().map(|unit| vec![unit]).collect();
    let mut out = Arrays { layout, made: Vec::new(), makers: HashMap::new() };
    let inputs = of(Stage::Inputs);
    let spared = layout.max_tasks.saturating_sub(inputs.len()).max(1);
    out.add(Stage::Inputs, alone(inputs));
    let first: BTreeSet<&JobId> = (open.iter())
        .flat_map(|job| job.needs.iter().filter(|need| goes_before(job, need)))
        .collect();
    let is_first = |unit: &Unit| unit.jobs.iter().any(|timed| first.contains(&timed.job.id));
    let (tried, train): (Vec<Unit>, Vec<Unit>) = of(Stage::Train).into_iter().partition(is_first);
    out.add(Stage::Train, alone(tried));
    let mut groups: BTreeMap<BTreeSet<After>, Vec<Unit>> = BTreeMap::new();
    for unit in train {
        groups.entry(out.after(&unit)).or_default().push(unit);
    }
    for group in pack(groups.into_values().collect(), layout, spared) {
        out.add(Stage::Train, group);
    }
    out.named()
}

/// Packs each group into chunks; into longer ones if they are too many.
fn pack(groups: Vec<Vec<Unit>>, layout: &Layout, max_tasks: usize) -> Vec<Vec<Vec<Unit>>> {
    let slots = layout.settings.slots(Stage::Train) as f64;
    let of_group = |group: &Vec<Unit>| group.iter().map(|unit| unit.seconds / slots).collect();
    let seconds: Vec<Vec<f64>> = groups.iter().map(of_group).collect();
    let all: f64 = seconds.iter().flatten().sum();
    let (target, parallel) = (layout.settings.target_s(), layout.settings.array_parallel());
    let mut length = length_s(all, target, parallel);
    let tasks = |length| seconds.iter().map(|group| count(group, length)).sum::<usize>();
    while tasks(length) > max_tasks.max(groups.len()) {
        length *= 1.25;
    }
    let packed = groups.into_iter().zip(&seconds).map(|(group, seconds)| {
        let units = group.into_iter().map(|unit| (unit.seconds, unit)).collect();
        pack_chunks(units, count(seconds, length))
    });
    packed.collect()
}

/// Whether a job waits for one of its own kind that runs before all others, in a separate array.
fn goes_before(job: &Job, need: &JobId) -> bool {
    [&job.id, need].iter().all(|id| id.kind == JobKind::Run)
}

/// Joins jobs that need one another within a stage, in the order in which they come.
fn units(jobs: Vec<&Job>, layout: &Layout) -> Vec<Unit> {
    let place: HashMap<&JobId, usize> =
        jobs.iter().enumerate().map(|(at, job)| (&job.id, at)).collect();
    let mut leader: Vec<usize> = (0..jobs.len()).collect();
    for (at, job) in jobs.iter().enumerate() {
        let joined = job.needs.iter().filter(|need| !goes_before(job, need));
        for need in joined.filter_map(|need| place.get(need)) {
            let (a, b) = (root(&mut leader, at), root(&mut leader, *need));
            leader[a.max(b)] = a.min(b);
        }
    }
    let mut units: BTreeMap<usize, Unit> = BTreeMap::new();
    for (at, job) in jobs.into_iter().enumerate() {
        let unit = units.entry(root(&mut leader, at)).or_default();
        let seconds = layout.estimates.seconds(job);
        unit.seconds += seconds;
        unit.jobs.push(Timed { job: job.clone(), seconds });
    }
    units.into_values().collect()
}

fn root(leader: &mut [usize], mut at: usize) -> usize {
    while leader[at] != at {
        leader[at] = leader[leader[at]];
        at = leader[at];
    }
    at
}

/// Arrays as they come to be.
struct Arrays<'a> {
    layout: &'a Layout<'a>,
    made: Vec<Array>,
    /// The task that makes each job's result.
    makers: HashMap<JobId, After>,
}

impl Arrays<'_> {
    /// The jobs that must succeed before a unit can start.
    fn after(&self, unit: &Unit) -> BTreeSet<After> {
        let needs = unit.jobs.iter().flat_map(|timed| &timed.job.needs);
        let task = |need: &JobId| match self.layout.queued.get(need) {
            Some(task) => Some(After::Queued(task.clone())),
            None => self.makers.get(need).cloned(),
        };
        needs.filter_map(task).collect()
    }

    /// Adds an array of chunks, or several if one would be too long.
    fn add(&mut self, stage: Stage, chunks: Vec<Vec<Unit>>) {
        for part in chunks.chunks(self.layout.max_array) {
            let after: BTreeSet<After> =
                part.iter().flatten().flat_map(|unit| self.after(unit)).collect();
            let array = self.made.len();
            for (index, chunk) in part.iter().enumerate() {
                let ids = chunk.iter().flat_map(|unit| &unit.jobs).map(|timed| &timed.job.id);
                self.makers.extend(ids.map(|id| (id.clone(), After::Ours { array, index })));
            }
            self.made.push(Array {
                name: String::new(),
                stage,
                chunks: part.iter().map(|chunk| self.chunk(chunk)).collect(),
                after: after.into_iter().collect(),
            });
        }
    }

    fn chunk(&self, units: &[Unit]) -> ChunkFile {
        let jobs: Vec<Timed> = units.iter().flat_map(|unit| unit.jobs.clone()).collect();
        let made: BTreeSet<&JobId> = jobs.iter().map(|timed| &timed.job.id).collect();
        let read: BTreeSet<JobId> =
            jobs.iter().flat_map(|timed| (self.layout.reads)(&timed.job.id)).collect();
        let needs = read.into_iter().filter(|need| !made.contains(need)).collect();
        ChunkFile { needs, jobs }
    }

    /// The arrays with their names, numbered if a stage has several.
    fn named(self) -> Vec<Array> {
        let stages: Vec<Stage> = self.made.iter().map(|array| array.stage).collect();
        let count = |stages: &[Stage], of| stages.iter().filter(|stage| **stage == of).count();
        let name = |(at, array): (usize, Array)| {
            let word = array.stage.word();
            let name = match count(&stages, array.stage) {
                1 => word.to_string(),
                _ => format!("{word}-{}", count(&stages[..=at], array.stage)),
            };
            Array { name, ..array }
        };
        self.made.into_iter().enumerate().map(name).collect()
    }
}

#[cfg(test)]
mod tests;

// Many short jobs into few tasks of about the same length.

/// Seconds below which a task is not worth its place in the queue.
const LEAST_S: f64 = 60.0;

/// Tasks that a cluster is taken to run at once, where nothing says how many.
const ASSUMED_PARALLEL: usize = 16;

/// Tasks a slot, so that the last to end does not hold up the rest for long.
const TASKS_PER_SLOT: usize = 3;

/// The target length of a task, given all the work in seconds: at most `target_s`, and short enough that each of
/// `parallel` slots gets three, but not below a minute.
pub fn length_s(all_s: f64, target_s: f64, parallel: Option<usize>) -> f64 {
    let tasks = TASKS_PER_SLOT * parallel.unwrap_or(ASSUMED_PARALLEL);
    (all_s / tasks as f64).max(LEAST_S).min(target_s)
}

/// The number of tasks of a length for the work of units that cannot be split.
pub fn count(units_s: &[f64], length_s: f64) -> usize {
    let all: f64 = units_s.iter().sum();
    ((all / length_s).ceil() as usize).clamp(1, units_s.len().max(1))
}

/// Packs units with their seconds into `count` bins, the longest unit first, each into the bin that
/// has least: the fullest bin holds at most 4/3 of what the best packing would (Graham 1969).
///
/// Bins come in the order of their work, the most first; so do the units of a bin.
pub fn pack_chunks<T>(mut units: Vec<(f64, T)>, count: usize) -> Vec<Vec<T>> {
    units.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut bins: Vec<(f64, Vec<T>)> = (0..count).map(|_| (0.0, Vec::new())).collect();
    for (seconds, unit) in units {
        let Some(least) = bins.iter_mut().min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
        least.0 += seconds;
        least.1.push(unit);
    }
    bins.sort_by(|a, b| b.0.total_cmp(&a.0));
    bins.into_iter().map(|(_, units)| units).filter(|units| !units.is_empty()).collect()
}

// [`Estimates`]: how long jobs take, before they have been done.

/// Seconds of a job that does nothing: a process is started, and files are opened.
const START_S: f64 = 1.0;

/// Records that are read for the rate: as many tell it as well as all.
const SAMPLE: usize = 200;

/// One rate for all jobs, and where it comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimates {
    pub flops_per_second: f64,
    /// For a person: `as the section says`.
    pub source: &'static str,
}

impl Estimates {
    /// The rate that the section gives.
    pub fn given(flops_per_second: f64) -> Self {
        Self { flops_per_second, source: "as flops_per_second says" }
    }

    /// The rate of the finished runs of a folder; `None` if there is none.
    ///
    /// # Errors
    /// A record is damaged.
    pub fn of_records(plan: &Plan, folder: &ResultsFolder) -> Result<Option<Self>, FileError> {
        let done = |run: &&PlannedRun| folder.state(&JobId::run(&run.run_id)) == JobState::Done;
        let sample = plan.runs.iter().filter(done).take(SAMPLE);
        let records = sample.map(|run| folder.record(&run.run_id));
        let records = records.collect::<Result<Vec<_>, FileError>>()?.into_iter().flatten();
        let source = "measured by finished runs";
        Ok(flops_per_second(records).map(|flops_per_second| Self { flops_per_second, source }))
    }

    /// The rate of a few training steps on this machine.
    pub fn of_probe(plan: &Plan, device: &Device) -> Self {
        Self::of_runs(plan, "measured here by a few steps", |jobs| {
            Speed::measured_of(jobs, plan, device, 1).hours(jobs, plan, 1)
        })
    }

    /// The mean rate of a plan's runs on a card.
    pub fn of_card(plan: &Plan, gpu: &Gpu) -> Self {
        Self::of_runs(plan, "by the MFU of engine.gpu", |jobs| gpu.hours(plan, jobs))
    }

    fn of_runs(plan: &Plan, source: &'static str, hours: impl Fn(&[Job]) -> f64) -> Self {
        let jobs = JobKind::Run.jobs(plan);
        let flops: f64 = jobs.iter().map(|job| job.cost).sum();
        let seconds = 3600.0 * hours(&jobs);
        let flops_per_second = if seconds > 0.0 { flops / seconds } else { f64::INFINITY };
        Self { flops_per_second, source }
    }

    /// Seconds that a job takes on a slot of its own.
    pub fn seconds(&self, job: &Job) -> f64 {
        START_S + job.cost / self.flops_per_second
    }
}
