//! [`Look`]: what the folders of all jobs tell, beside the plan.

use std::collections::{BTreeMap, HashMap, HashSet};

use rayon::prelude::*;
use serde::Deserialize;

use super::share::share_done;
use super::sweep_state::{Counts, FailedJob, Running, SweepState};
use crate::jobs::history::{Finished, known};
use crate::jobs::presence::{self, is_locked};
use crate::jobs::speed::{Speed, seconds_left};
use crate::jobs::{Job, JobId, JobKind, JobState, ResultsFolder};
use crate::progress::{Beat, progress};
use crate::spec::RunSpec;
use crate::sweep::Stage;

/// What is read of `plan.json`.
#[derive(Deserialize)]
pub struct Planned {
    pub runs: Vec<PlannedRun>,
    pub inputs: Vec<Job>,
}

#[derive(Deserialize)]
pub struct PlannedRun {
    pub run_id: String,
    /// As `tokens 8a0f68a1`.
    pub needs: Vec<String>,
    pub own_flops: f64,
    pub trunk_id: Option<String>,
    #[serde(default)]
    params_nonvocab: usize,
    #[serde(default)]
    params_vocab: usize,
    #[serde(default)]
    params_text: usize,
}

impl PlannedRun {
    fn id(&self) -> JobId {
        JobId::run(self.run_id.as_str())
    }

    fn params(&self) -> usize {
        self.params_nonvocab + self.params_vocab + self.params_text
    }
}

/// What a look at a job's folder tells.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Seen {
    At(JobState),
    /// The share that its checkpoint holds.
    Started(f64),
    /// What it last said, and the share that its checkpoint holds.
    Running(Option<Beat>, f64),
}

fn see(folder: &ResultsFolder, job: &JobId) -> Seen {
    let state = folder.state(job);
    let unfinished = matches!(state, JobState::Missing | JobState::Started);
    let place = folder.job(job);
    let share_done = || share_done(folder, job).unwrap_or(0.0);
    match state {
        _ if unfinished && is_locked(&place) => match progress(&place) {
            Some(beat) => Seen::Running(Some(beat), 0.0),
            None => Seen::Running(None, share_done()),
        },
        JobState::Started => Seen::Started(share_done()),
        state => Seen::At(state),
    }
}

/// A job of the plan, and what was seen of it.
struct Looked<'a> {
    id: JobId,
    /// `None` for a run, whose spec has it.
    label: Option<&'a str>,
    cost: f64,
    /// Those of the generator that it trains.
    params: Option<usize>,
    /// Whether it failed, or needs something that did.
    is_lost: bool,
    seen: Seen,
}

/// Everything that was seen, beside the plan, in its order.
pub struct Look<'a> {
    folder: &'a ResultsFolder,
    plan: &'a Planned,
    jobs: Vec<Looked<'a>>,
}

impl<'a> Look<'a> {
    /// Looks at every job; a finished run costs one look at whether its record is there.
    pub fn at(folder: &'a ResultsFolder, plan: &'a Planned) -> Self {
        let inputs: Vec<Seen> = plan.inputs.iter().map(|job| see(folder, &job.id)).collect();
        let runs: Vec<Seen> = plan.runs.par_iter().map(|run| see(folder, &run.id())).collect();
        let lost = lost(plan, &inputs, &runs);
        // A trunk's generator is that of the runs that branch off.
        let of_trunk = |run: &'a PlannedRun| Some((run.trunk_id.as_deref()?, run.params()));
        let of_trunks: HashMap<&str, usize> = plan.runs.iter().filter_map(of_trunk).collect();
        let input = |(job, seen): (&'a Job, Seen)| Looked {
            id: job.id.clone(),
            label: Some(&job.label),
            cost: job.cost,
            params: of_trunks.get(job.id.id.as_str()).copied(),
            is_lost: lost.contains(&job.id),
            seen,
        };
        let run = |(run, seen): (&'a PlannedRun, Seen)| Looked {
            id: run.id(),
            label: None,
            cost: run.own_flops,
            params: Some(run.params()),
            is_lost: lost.iter().any(|id| run.needs.contains(&id.to_string())),
            seen,
        };
        let inputs = plan.inputs.iter().zip(inputs).map(input);
        let jobs = inputs.chain(plan.runs.iter().zip(runs).map(run)).collect();
        Self { folder, plan, jobs }
    }

    /// How far the sweep is.
    pub fn state(&self) -> SweepState {
        let (finished, mut warnings) = self.finished();
        let speed = known(self.folder, &finished);
        let left = |slots| speed.as_ref().map(|speed| self.seconds_left(speed, slots, &|_| true));
        let (failures, running) = (self.failures(&mut warnings), self.running());
        let mut inputs = self.counts();
        SweepState {
            at_work: presence::is_held(self.folder),
            scheduler: presence::scheduler(self.folder),
            runs: inputs.remove(&JobKind::Run).unwrap_or_default(),
            inputs,
            failures,
            warnings,
            flops_total: self.trained(|_| 1.0),
            flops_done: self.trained(done),
            job_seconds_left: left(1),
            eta_s: left(running.len()).filter(|_| !running.is_empty()),
            running,
        }
    }

    /// Seconds until what is wanted and can still be done is done on `slots` slots; `None` if it is not known how
    /// fast runs are.
    pub fn time_left(&self, slots: usize, wanted: &dyn Fn(&JobId) -> bool) -> Option<f64> {
        let speed = known(self.folder, &self.finished().0)?;
        Some(self.seconds_left(&speed, slots, wanted))
    }

    fn seconds_left(&self, speed: &Speed, slots: usize, wanted: &dyn Fn(&JobId) -> bool) -> f64 {
        let to_do = self.jobs.iter().filter(|job| wanted(&job.id) && !job.is_lost);
        seconds_left(to_do.map(|job| speed.seconds(job.cost * left(job.seen), job.params)), slots)
    }

    fn counts(&self) -> BTreeMap<JobKind, Counts> {
        let mut counts: BTreeMap<JobKind, Counts> = BTreeMap::new();
        for job in &self.jobs {
            add(counts.entry(job.id.kind).or_default(), job.seen, job.is_lost && open(job.seen));
        }
        counts
    }

    /// FLOPs of runs and trunks, each weighed by how far it is.
    fn trained(&self, share: impl Fn(Seen) -> f64) -> f64 {
        let trained = self.jobs.iter().filter(|job| job.id.kind.stage() == Stage::Train);
        trained.map(|job| job.cost * share(job.seen)).sum()
    }

    fn running(&self) -> Vec<Running> {
        let running = |job: &Looked| match job.seen {
            Seen::Running(progress, _) => {
                Some(Running { id: job.id.clone(), label: self.label(job), progress })
            }
            _ => None,
        };
        self.jobs.iter().filter_map(running).collect()
    }

    fn failures(&self, warnings: &mut Vec<String>) -> Vec<FailedJob> {
        let mut failures = Vec::new();
        for job in self.jobs.iter().filter(|job| job.seen == Seen::At(JobState::Failed)) {
            let named = |failure| FailedJob::new(job.id.clone(), self.label(job), failure);
            match self.folder.failure(&job.id) {
                Ok(read) => failures.extend(read.map(named)),
                Err(error) => warnings.push(error.to_string()),
            }
        }
        failures
    }

    /// The name of a job for a person.
    fn label(&self, job: &Looked) -> String {
        let of_run = || match self.folder.known_spec::<RunSpec>(&job.id) {
            Some(spec) => spec.label(),
            None => job.id.to_string(),
        };
        job.label.map_or_else(of_run, str::to_string)
    }

    /// What is done, and what was wrong with records.
    fn finished(&self) -> (Finished, Vec<String>) {
        let done = self.jobs.iter().filter(|job| job.seen == Seen::At(JobState::Done));
        let runs = done.filter(|job| job.id.kind == JobKind::Run);
        let runs: Vec<_> = runs.filter_map(|run| Some((run.params?, run.id.id.as_str()))).collect();
        Finished::read(self.folder, &runs, &self.plan.inputs)
    }
}

/// What failed, and what needs it: the plan has every input after what it needs.
fn lost(plan: &Planned, inputs: &[Seen], runs: &[Seen]) -> HashSet<JobId> {
    let mut lost = HashSet::new();
    for (job, seen) in plan.inputs.iter().zip(inputs) {
        let orphan = open(*seen) && job.needs.iter().any(|need| lost.contains(need));
        if orphan || *seen == Seen::At(JobState::Failed) {
            lost.insert(job.id.clone());
        }
    }
    // A run that tries the trainer for all others.
    let needed: HashSet<&String> = plan.runs.iter().flat_map(|run| &run.needs).collect();
    let runs = plan.runs.iter().zip(runs);
    let failed = runs.filter(|(_, seen)| **seen == Seen::At(JobState::Failed));
    let failed = failed.map(|(run, _)| run.id());
    lost.extend(failed.filter(|run| needed.contains(&run.to_string())));
    lost
}

/// Counts a job.
fn add(counts: &mut Counts, seen: Seen, blocked: bool) {
    counts.blocked += usize::from(blocked);
    *match seen {
        Seen::At(JobState::Done) => &mut counts.done,
        Seen::At(JobState::Failed) => &mut counts.failed,
        Seen::At(JobState::Started) | Seen::Started(_) => &mut counts.started,
        Seen::At(JobState::Missing) => &mut counts.missing,
        Seen::Running(..) => &mut counts.running,
    } += 1;
}

fn open(seen: Seen) -> bool {
    !matches!(seen, Seen::At(JobState::Done | JobState::Failed))
}

/// The share of a job that is done.
fn done(seen: Seen) -> f64 {
    match seen {
        Seen::At(JobState::Done) => 1.0,
        Seen::Running(Some(beat), _) => (beat.step as f64 / beat.steps.max(1) as f64).min(1.0),
        Seen::Running(None, share) | Seen::Started(share) => share,
        Seen::At(_) => 0.0,
    }
}

/// The share of a job that the next hours hold: nothing of one that failed.
fn left(seen: Seen) -> f64 {
    if seen == Seen::At(JobState::Failed) { 0.0 } else { 1.0 - done(seen) }
}
