//! [`Look`]: what the folders of all jobs tell, beside the plan.

use std::collections::{BTreeMap, HashMap, HashSet};

use rayon::prelude::*;
use serde::Deserialize;

use super::sweep_state::{Counts, FailedJob, Running, SweepState};
use crate::files::read_if_there;
use crate::jobs::history::{Finished, costs, known};
use crate::jobs::presence::{self, is_locked};
use crate::jobs::speed::{Speed, seconds_left};
use crate::jobs::{Job, JobId, JobKind, JobState, ResultsFolder};
use crate::plan::RunSpec;
use crate::progress::{Beat, progress};
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
    pub trunk_id: Option<String>,
    #[serde(default)]
    params_nonvocab: usize,
    #[serde(default)]
    params_vocab: usize,
    #[serde(default)]
    params_text: usize,
}

impl PlannedRun {
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
    let share_done = || job.kind.share_done(folder, &job.id);
    match state {
        _ if unfinished && is_locked(&place) => match progress(&place) {
            Some(beat) => Seen::Running(Some(beat), 0.0),
            None => Seen::Running(None, share_done()),
        },
        JobState::Started => Seen::Started(share_done()),
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
        let (finished, mut warnings) = self.finished();
        let speed = known(self.folder, &finished);
        let failures = self.failures(&mut warnings);
        let all = |_: &JobId| true;
        let left = |slots| speed.as_ref().map(|speed| self.seconds_left(speed, &lost, slots, &all));
        SweepState {
            at_work: presence::is_held(self.folder),
            scheduler: presence::scheduler(self.folder),
            inputs: self.count_inputs(&lost),
            runs: self.count_runs(&lost),
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
        Some(self.seconds_left(&speed, &self.lost(), slots, wanted))
    }

    fn seconds_left(
        &self,
        speed: &Speed,
        lost: &HashSet<JobId>,
        slots: usize,
        wanted: &dyn Fn(&JobId) -> bool,
    ) -> f64 {
        let to_do = self.to_do(lost, wanted);
        seconds_left(to_do.map(|(cost, params)| speed.seconds(cost, params)), slots)
    }

    fn seen_runs(&self) -> impl Iterator<Item = (&PlannedRun, Seen)> {
        self.plan.runs.iter().zip(self.runs.iter().copied())
    }

    fn seen_inputs(&self) -> impl Iterator<Item = (&Job, Seen)> {
        self.plan.inputs.iter().zip(self.inputs.iter().copied())
    }

    /// What failed, and what needs it: the plan has every input after what it needs.
    fn lost(&self) -> HashSet<JobId> {
        let mut lost = HashSet::new();
        for (job, seen) in self.seen_inputs() {
            let orphan = open(seen) && job.needs.iter().any(|need| lost.contains(need));
            if orphan || seen == Seen::At(JobState::Failed) {
                lost.insert(job.id.clone());
            }
        }
        // A run that tries the trainer for all others.
        let needed: HashSet<&String> = self.plan.runs.iter().flat_map(|run| &run.needs).collect();
        let failed = self.seen_runs().filter(|(_, seen)| *seen == Seen::At(JobState::Failed));
        let failed = failed.map(|(run, _)| JobId::run(run.run_id.as_str()));
        lost.extend(failed.filter(|run| needed.contains(&run.to_string())));
        lost
    }

    fn count_inputs(&self, lost: &HashSet<JobId>) -> BTreeMap<JobKind, Counts> {
        let mut counts: BTreeMap<JobKind, Counts> = BTreeMap::new();
        for (job, seen) in self.seen_inputs() {
            let blocked = open(seen) && lost.contains(&job.id);
            add(counts.entry(job.id.kind).or_default(), seen, blocked);
        }
        counts
    }

    fn count_runs(&self, lost: &HashSet<JobId>) -> Counts {
        let mut counts = Counts::default();
        for (run, seen) in self.seen_runs() {
            add(&mut counts, seen, open(seen) && is_blocked(run, lost));
        }
        counts
    }

    /// What is left of the cost of each job that can still be done, and the parameters of the generator that it
    /// trains.
    fn to_do(
        &self,
        lost: &HashSet<JobId>,
        wanted: &dyn Fn(&JobId) -> bool,
    ) -> impl Iterator<Item = (f64, Option<usize>)> {
        let of_trunks = self.params_of_trunks();
        let is_wanted = |run: &PlannedRun| wanted(&JobId::run(run.run_id.as_str()));
        let inputs = self.seen_inputs();
        let inputs = inputs.filter(|(job, _)| wanted(&job.id) && !lost.contains(&job.id));
        let runs = self.seen_runs();
        let runs = runs.filter(move |(run, _)| is_wanted(run) && !is_blocked(run, lost));
        let inputs = inputs.map(move |(job, seen)| {
            (job.cost * left(seen), of_trunks.get(job.id.id.as_str()).copied())
        });
        inputs.chain(runs.map(|(run, seen)| (run.own_flops * left(seen), Some(run.params()))))
    }

    /// A trunk's generator is that of the runs that branch off.
    fn params_of_trunks(&self) -> HashMap<&str, usize> {
        let of = |run: &'a PlannedRun| Some((run.trunk_id.as_deref()?, run.params()));
        self.plan.runs.iter().filter_map(of).collect()
    }

    /// FLOPs of runs and trunks, each weighed by how far it is.
    fn trained(&self, share: impl Fn(Seen) -> f64) -> f64 {
        let trunks = self.seen_inputs().filter(|(job, _)| job.id.kind.stage() == Stage::Train);
        let trunks: f64 = trunks.map(|(job, seen)| job.cost * share(seen)).sum();
        trunks + self.seen_runs().map(|(run, seen)| run.own_flops * share(seen)).sum::<f64>()
    }

    fn running(&self) -> Vec<Running> {
        let at_work = |seen| matches!(seen, Seen::Running(..));
        let running = |(id, label, seen)| match seen {
            Seen::Running(progress, _) => Running { id, label, progress },
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

    /// What is done of runs, spread over the plan, and of other jobs; and what was wrong with their records.
    fn finished(&self) -> (Finished, Vec<String>) {
        let done = self.seen_runs().filter(|(_, seen)| *seen == Seen::At(JobState::Done));
        let done: Vec<&PlannedRun> = done.map(|(run, _)| run).collect();
        let (mut runs, mut warnings) = (Vec::new(), Vec::new());
        for run in done.iter().step_by(done.len().div_ceil(RATE_SAMPLE).max(1)) {
            match self.folder.record(&run.run_id) {
                Ok(record) => runs.extend(record.map(|record| (run.params(), record))),
                Err(error) => warnings.push(error.to_string()),
            }
        }
        (Finished { runs, inputs: costs(&self.plan.inputs) }, warnings)
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
        Seen::Running(..) => &mut counts.running,
    } += 1;
}

fn open(seen: Seen) -> bool {
    !matches!(seen, Seen::At(JobState::Done | JobState::Failed))
}

/// Whether something that a run needs will not come.
fn is_blocked(run: &PlannedRun, lost: &HashSet<JobId>) -> bool {
    lost.iter().any(|id| run.needs.contains(&id.to_string()))
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

fn label_of_run(folder: &ResultsFolder, id: &str) -> String {
    let spec: Option<RunSpec> = read_if_there(&folder.spec(&JobId::run(id))).ok().flatten();
    spec.map_or_else(|| format!("run {id}"), |spec| spec.label())
}
