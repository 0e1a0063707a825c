//! [`Look`]: what the folders of all jobs tell, beside the plan.

use std::collections::{BTreeMap, HashSet};

use rayon::prelude::*;
use serde::Deserialize;

use super::sweep_state::{Counts, FailedJob, Running, SweepState};
use crate::files::read_if_there;
use crate::jobs::presence::{self, is_locked};
use crate::jobs::{Job, JobId, JobKind, JobState, ResultsFolder};
use crate::plan::RunSpec;
use crate::progress::{Beat, progress};
use crate::record::flops_per_second;
use crate::sweep::Stage;

/// Records that are read for the rate: as many tell it as well as all.
const RATE_SAMPLE: usize = 200;

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
}

/// What a look at a job's folder tells.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Seen {
    At(JobState),
    /// The share that its checkpoint holds.
    Started(f64),
    Running(Option<Beat>),
}

fn see(folder: &ResultsFolder, job: &JobId) -> Seen {
    let state = folder.state(job);
    let unfinished = matches!(state, JobState::Missing | JobState::Started);
    let place = folder.job(job);
    match state {
        _ if unfinished && is_locked(&place) => Seen::Running(progress(&place)),
        JobState::Started => Seen::Started(job.kind.share_done(folder, &job.id)),
        state => Seen::At(state),
    }
}

/// Everything that was seen, beside the plan, in its order.
pub struct Look<'a> {
    folder: &'a ResultsFolder,
    plan: &'a Planned,
    inputs: Vec<Seen>,
    runs: Vec<Seen>,
}

impl<'a> Look<'a> {
    /// Looks at every job; a finished run costs one look at whether its record is there.
    pub fn at(folder: &'a ResultsFolder, plan: &'a Planned) -> Self {
        let inputs = plan.inputs.iter().map(|job| see(folder, &job.id)).collect();
        let see_run = |run: &PlannedRun| see(folder, &JobId::run(run.run_id.as_str()));
        let runs = plan.runs.par_iter().map(see_run).collect();
        Self { folder, plan, inputs, runs }
    }

    /// How far the sweep is.
    pub fn state(&self) -> SweepState {
        let lost = self.lost();
        let running = self.running();
        let (sum, longest) =
            self.to_do(&lost).fold((0.0, 0.0_f64), |(s, l), cost| (s + cost, l.max(cost)));
        let (rate, mut warnings) = self.flops_per_second();
        let failures = self.failures(&mut warnings);
        let at_once = running.len() as f64;
        SweepState {
            at_work: presence::is_held(self.folder),
            scheduler: presence::scheduler(self.folder),
            inputs: self.count_inputs(&lost),
            runs: self.count_runs(&lost),
            failures,
            warnings,
            flops_total: self.trained(|_| 1.0),
            flops_done: self.trained(done),
            job_seconds_left: rate.map(|rate| sum / rate),
            eta_s: rate
                .filter(|_| !running.is_empty())
                .map(|rate| (sum / at_once).max(longest) / rate),
            running,
        }
    }

    fn seen_runs(&self) -> impl Iterator<Item = (&PlannedRun, Seen)> {
        self.plan.runs.iter().zip(self.runs.iter().copied())
    }

    fn seen_inputs(&self) -> impl Iterator<Item = (&Job, Seen)> {
        self.plan.inputs.iter().zip(self.inputs.iter().copied())
    }

    /// What failed, and what needs it: the plan has every input after what it needs.
    fn lost(&self) -> HashSet<&JobId> {
        let mut lost = HashSet::new();
        for (job, seen) in self.seen_inputs() {
            let orphan = open(seen) && job.needs.iter().any(|need| lost.contains(need));
            if orphan || seen == Seen::At(JobState::Failed) {
                lost.insert(&job.id);
            }
        }
        lost
    }

    fn count_inputs(&self, lost: &HashSet<&JobId>) -> BTreeMap<JobKind, Counts> {
        let mut counts: BTreeMap<JobKind, Counts> = BTreeMap::new();
        for (job, seen) in self.seen_inputs() {
            let blocked = open(seen) && lost.contains(&job.id);
            add(counts.entry(job.id.kind).or_default(), seen, blocked);
        }
        counts
    }

    fn count_runs(&self, lost: &HashSet<&JobId>) -> Counts {
        let mut counts = Counts::default();
        for (run, seen) in self.seen_runs() {
            add(&mut counts, seen, open(seen) && is_blocked(run, lost));
        }
        counts
    }

    /// What is left of each job that can still be done.
    fn to_do(&self, lost: &HashSet<&JobId>) -> impl Iterator<Item = f64> {
        let inputs = self.seen_inputs().filter(|(job, _)| !lost.contains(&job.id));
        let runs = self.seen_runs().filter(|(run, _)| !is_blocked(run, lost));
        let inputs = inputs.map(|(job, seen)| job.cost * left(seen));
        inputs.chain(runs.map(|(run, seen)| run.own_flops * left(seen)))
    }

    /// FLOPs of runs and trunks, each weighed by how far it is.
    fn trained(&self, share: impl Fn(Seen) -> f64) -> f64 {
        let trunks = self.seen_inputs().filter(|(job, _)| job.id.kind.stage() == Stage::Train);
        let trunks: f64 = trunks.map(|(job, seen)| job.cost * share(seen)).sum();
        trunks + self.seen_runs().map(|(run, seen)| run.own_flops * share(seen)).sum::<f64>()
    }

    fn running(&self) -> Vec<Running> {
        let at_work = |seen| matches!(seen, Seen::Running(_));
        let running = |(id, label, seen)| match seen {
            Seen::Running(progress) => Running { id, label, progress },
            _ => unreachable!("only those at work are asked for"),
        };
        self.named(at_work).into_iter().map(running).collect()
    }

    fn failures(&self, warnings: &mut Vec<String>) -> Vec<FailedJob> {
        let mut failures = Vec::new();
        for (id, label, _) in self.named(|seen| seen == Seen::At(JobState::Failed)) {
            match self.folder.failure(&id) {
                Ok(read) => {
                    failures.extend(read.map(|failure| FailedJob::new(id, label, failure)));
                }
                Err(error) => warnings.push(error.to_string()),
            }
        }
        failures
    }

    /// The jobs of a kind of look, with their names for a person.
    fn named(&self, wanted: impl Fn(Seen) -> bool) -> Vec<(JobId, String, Seen)> {
        let inputs = self.seen_inputs().filter(|(_, seen)| wanted(*seen));
        let mut named: Vec<_> =
            inputs.map(|(job, seen)| (job.id.clone(), job.label.clone(), seen)).collect();
        for (run, seen) in self.seen_runs().filter(|(_, seen)| wanted(*seen)) {
            let label = label_of_run(self.folder, &run.run_id);
            named.push((JobId::run(run.run_id.as_str()), label, seen));
        }
        named
    }

    /// FLOPs a second of one job, from finished runs spread over the plan, and what was wrong with
    /// their records.
    fn flops_per_second(&self) -> (Option<f64>, Vec<String>) {
        let finished = self.seen_runs().filter(|(_, seen)| *seen == Seen::At(JobState::Done));
        let finished: Vec<&PlannedRun> = finished.map(|(run, _)| run).collect();
        let (mut records, mut warnings) = (Vec::new(), Vec::new());
        for run in finished.iter().step_by(finished.len().div_ceil(RATE_SAMPLE).max(1)) {
            match self.folder.record(&run.run_id) {
                Ok(record) => records.extend(record),
                Err(error) => warnings.push(error.to_string()),
            }
        }
        (flops_per_second(records), warnings)
    }
}

/// Counts a job.
fn add(counts: &mut Counts, seen: Seen, blocked: bool) {
    counts.blocked += usize::from(blocked);
    *match seen {
        Seen::At(JobState::Done) => &mut counts.done,
        Seen::At(JobState::Failed) => &mut counts.failed,
        Seen::At(JobState::Started) | Seen::Started(_) => &mut counts.started,
        Seen::At(JobState::Missing) => &mut counts.missing,
        Seen::Running(_) => &mut counts.running,
    } += 1;
}

fn open(seen: Seen) -> bool {
    !matches!(seen, Seen::At(JobState::Done | JobState::Failed))
}

/// Whether something that a run needs will not come.
fn is_blocked(run: &PlannedRun, lost: &HashSet<&JobId>) -> bool {
    lost.iter().any(|id| run.needs.contains(&id.to_string()))
}

/// The share of a job that is done.
fn done(seen: Seen) -> f64 {
    match seen {
        Seen::At(JobState::Done) => 1.0,
        Seen::Running(Some(beat)) => (beat.step as f64 / beat.steps.max(1) as f64).min(1.0),
        Seen::Started(share) => share,
        Seen::At(_) | Seen::Running(None) => 0.0,
    }
}

/// The share of a job that the next hours hold: nothing of one that failed.
fn left(seen: Seen) -> f64 {
    if seen == Seen::At(JobState::Failed) { 0.0 } else { 1.0 - done(seen) }
}

fn label_of_run(folder: &ResultsFolder, id: &str) -> String {
    let spec: Option<RunSpec> = read_if_there(&folder.spec(&JobId::run(id))).ok().flatten();
    spec.map_or_else(|| format!("run {id}"), |spec| spec.label())
}
