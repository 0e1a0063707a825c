//! [`SweepState`]: how far a sweep is, from its folder alone.

use std::collections::{BTreeMap, HashSet};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::failure::{Failure, FailureKind};
use crate::files::{FileError, read_if_there};
use crate::jobs::Job;
use crate::jobs::presence;
use crate::jobs::presence::{Scheduler, is_locked};
use crate::jobs::{JobId, JobKind, JobState, ResultsFolder};
use crate::plan::RunSpec;
use crate::progress::{Beat, progress};
use crate::record::flops_per_second;
use crate::sweep::Stage;

/// Records that are read for the rate: as many tell it as well as all.
const RATE_SAMPLE: usize = 200;

/// Jobs by how far they are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    pub done: usize,
    pub failed: usize,
    /// A worker is at it now.
    pub running: usize,
    /// Interrupted, with a checkpoint to go on from.
    pub started: usize,
    pub missing: usize,
    /// Among the missing: jobs that need something that failed, which are not started.
    pub blocked: usize,
}

impl Counts {
    /// All of them.
    pub fn total(&self) -> usize {
        self.done + self.failed + self.running + self.started + self.missing
    }

    fn add(&mut self, seen: Seen, blocked: bool) {
        self.blocked += usize::from(blocked);
        *match seen {
            Seen::At(JobState::Done) => &mut self.done,
            Seen::At(JobState::Failed) => &mut self.failed,
            Seen::At(JobState::Started) | Seen::Started(_) => &mut self.started,
            Seen::At(JobState::Missing) => &mut self.missing,
            Seen::Running(_) => &mut self.running,
        } += 1;
    }
}

/// A job that a worker is at.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Running {
    #[serde(flatten)]
    pub id: JobId,
    pub label: String,
    /// `None` before its first step.
    pub progress: Option<Beat>,
}

/// A job that failed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FailedJob {
    #[serde(flatten)]
    pub id: JobId,
    pub label: String,
    /// What went wrong; `kind` is the job's.
    #[serde(rename = "failure")]
    pub failure_kind: FailureKind,
    pub reason: String,
    pub last_lines: Vec<String>,
}

impl FailedJob {
    fn new(id: JobId, label: String, failure: Failure) -> Self {
        let Failure { kind: failure_kind, reason, last_lines } = failure;
        Self { id, label, failure_kind, reason, last_lines }
    }
}

/// How far a sweep is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SweepState {
    /// Whether a scheduler is at work on the folder.
    pub at_work: bool,
    /// Which one; unknown for a moment after its start.
    pub scheduler: Option<Scheduler>,
    /// What the runs need, by kind.
    pub inputs: BTreeMap<JobKind, Counts>,
    pub runs: Counts,
    pub running: Vec<Running>,
    pub failures: Vec<FailedJob>,
    /// FLOPs of all runs and trunks, and of those done with the part of those running.
    pub flops_total: f64,
    pub flops_done: f64,
    /// Seconds of work for one job at a time, by the rate of finished runs; what failed, and what
    /// waits for it, is left out.
    pub job_seconds_left: Option<f64>,
    /// Seconds to the end with as many jobs at work as now.
    pub eta_s: Option<f64>,
    /// Files that are damaged, and how to mend each.
    pub warnings: Vec<String>,
}

/// What is read of `plan.json`.
#[derive(Deserialize)]
struct Planned {
    runs: Vec<PlannedRun>,
    inputs: Vec<Job>,
}

#[derive(Deserialize)]
struct PlannedRun {
    run_id: String,
    /// As `tokens 8a0f68a1`.
    needs: Vec<String>,
    own_flops: f64,
}

/// What a look at a job's folder tells.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Seen {
    At(JobState),
    /// The share that its checkpoint holds.
    Started(f64),
    Running(Option<Beat>),
}

/// Reads how far a sweep is; `None` where the folder is no sweep's.
///
/// A finished run costs one look at whether its record is there.
///
/// # Errors
/// A file is damaged, or cannot be read.
pub fn sweep_state(folder: &ResultsFolder) -> Result<Option<SweepState>, FileError> {
    let Some(plan) = read_if_there::<Planned>(&folder.file("plan.json"))? else { return Ok(None) };
    let inputs = plan.inputs.iter().map(|job| see(folder, &job.id)).collect();
    let runs = plan.runs.par_iter().map(|run| see(folder, &JobId::run(run.run_id.as_str())));
    let look = Look { folder, plan: &plan, inputs, runs: runs.collect() };
    Ok(Some(look.state()))
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
struct Look<'a> {
    folder: &'a ResultsFolder,
    plan: &'a Planned,
    inputs: Vec<Seen>,
    runs: Vec<Seen>,
}

impl Look<'_> {
    fn state(&self) -> SweepState {
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
            counts.entry(job.id.kind).or_default().add(seen, blocked);
        }
        counts
    }

    fn count_runs(&self, lost: &HashSet<&JobId>) -> Counts {
        let mut counts = Counts::default();
        for (run, seen) in self.seen_runs() {
            counts.add(seen, open(seen) && is_blocked(run, lost));
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

#[cfg(test)]
mod tests {
    use std::fs::{self, File};

    use serde_json::json;

    use super::*;
    use crate::files::atomic::write_json;

    /// A folder whose plan has runs of 1, 2, 3, … FLOPs named `0`, `1`, `2`, …
    fn planned(place: &tempfile::TempDir, runs: usize) -> ResultsFolder {
        let folder = ResultsFolder::new(place.path());
        let run = |i: usize| json!({"run_id": i.to_string(), "needs": ["tokens t"], "own_flops": i as f64 + 1.0});
        let runs: Vec<_> = (0..runs).map(run).collect();
        let input = |kind: &str, needs: &[serde_json::Value]| {
            let id = json!({"kind": kind, "id": "t"});
            json!({"id": id, "label": kind, "cost": 1.0, "peak_bytes": 0, "needs": needs})
        };
        let needed = json!({"kind": "tokenizer", "id": "t"});
        let inputs = [input("tokenizer", &[]), input("tokens", &[needed])];
        let plan = json!({"runs": runs, "inputs": inputs});
        write_json(&folder.file("plan.json"), &plan).unwrap();
        folder
    }

    #[test]
    fn a_folder_without_a_plan_is_no_sweeps() {
        let place = tempfile::tempdir().unwrap();
        assert_eq!(sweep_state(&ResultsFolder::new(place.path())).unwrap(), None);
    }

    #[test]
    fn a_live_worker_is_told_from_what_a_dead_one_left() {
        let place = tempfile::tempdir().unwrap();
        let folder = planned(&place, 3);
        for id in ["0", "1"] {
            fs::create_dir_all(folder.run(id).join("checkpoint")).unwrap();
            let beat = Beat { step: 1, steps: 4, loss: 2.0, train_s: 0.5 };
            crate::progress::note_progress(&folder.run(id), &beat);
        }
        fs::write(folder.run("0").join(".lock"), "").unwrap();
        let lock = File::create(folder.run("1").join(".lock")).unwrap();
        lock.try_lock().unwrap();
        let state = sweep_state(&folder).unwrap().unwrap();
        let expected = Counts { started: 1, running: 1, missing: 1, ..Counts::default() };
        assert_eq!(state.runs, expected);
        assert_eq!(state.running.len(), 1);
        assert_eq!(state.running[0].id, JobId::run("1"));
        assert_eq!(state.flops_done, 0.25 * 2.0);
        assert_eq!(state.flops_total, 6.0);
    }

    #[test]
    fn runs_of_a_failed_tokenizer_are_told_from_those_to_come() {
        let place = tempfile::tempdir().unwrap();
        let folder = planned(&place, 2);
        let failure = Failure::new(FailureKind::Diverged, "the loss is NaN");
        write_json(&folder.tokenizer("t").join("failure.json"), &failure).unwrap();
        let state = sweep_state(&folder).unwrap().unwrap();
        assert_eq!(state.runs, Counts { missing: 2, blocked: 2, ..Counts::default() });
        let tokens = state.inputs[&JobKind::of("tokens").unwrap()];
        assert_eq!(tokens, Counts { missing: 1, blocked: 1, ..Counts::default() });
        assert_eq!(state.failures[0].reason, failure.reason);
        assert_eq!(state.failures[0].failure_kind, FailureKind::Diverged);
    }
}
