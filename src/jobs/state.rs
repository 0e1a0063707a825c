//! The progress of a sweep, from its folder alone.

use std::collections::{BTreeMap, HashMap, HashSet};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::folder::{JobState, ResultsFolder};
use super::job::{Job, JobId, JobKind};
use super::presence::{self, Scheduler};
use super::seen::{Counts, Seen};
use super::speed::{Finished, Speed, known, seconds_left};
use crate::failure::{Failure, FailureKind};
use crate::files::{FileError, read_if_there};
use crate::progress::Beat;
use crate::spec::RunSpec;
use crate::sweep::Stage;

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
    /// A failure; `kind` is the job's.
    #[serde(rename = "failure")]
    pub failure_kind: FailureKind,
    pub reason: String,
    pub last_lines: Vec<String>,
}

impl FailedJob {
    /// A failure with the name of its job.
    pub fn new(id: JobId, label: String, failure: Failure) -> Self {
        let Failure { kind: failure_kind, reason, last_lines } = failure;
        Self { id, label, failure_kind, reason, last_lines }
    }
}

/// The progress of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SweepState {
    /// Whether a scheduler is at work on the folder.
    pub at_work: bool,
    /// Which one; unknown for a moment after its start.
    pub scheduler: Option<Scheduler>,
    /// The dependencies of runs, by kind.
    pub inputs: BTreeMap<JobKind, Counts>,
    pub runs: Counts,
    pub running: Vec<Running>,
    pub failures: Vec<FailedJob>,
    /// FLOPs of all runs and trunks, and of those done with the part of those running.
    pub flops_total: f64,
    pub flops_done: f64,
    /// Seconds of work for one job at a time, by the rate of finished runs, without failed jobs and jobs that wait for
    /// them.
    pub job_seconds_left: Option<f64>,
    /// Seconds to the end with as many jobs at work as now.
    pub eta_s: Option<f64>,
    /// Damaged files with their remedies.
    pub warnings: Vec<String>,
}

/// Seconds until the wanted jobs that can still be done are done on parallel slots; `None` if the speed of runs is
/// unknown. Running jobs count with their remaining work.
///
/// # Errors
/// A file is damaged, or cannot be read.
pub fn time_left(
    folder: &ResultsFolder,
    slots: usize,
    wanted: &dyn Fn(&JobId) -> bool,
) -> Result<Option<f64>, FileError> {
    let plan: Option<Planned> = read_if_there(&folder.file("plan.json"))?;
    Ok(plan.and_then(|plan| {
        let look = Look::at(folder, &plan);
        let speed = known(folder, &look.finished().0)?;
        Some(look.seconds_left(&speed, slots, wanted))
    }))
}

/// Reads how far a sweep is; `None` if the folder is no sweep's.
///
/// # Errors
/// A file is damaged, or cannot be read.
pub fn sweep_state(folder: &ResultsFolder) -> Result<Option<SweepState>, FileError> {
    let plan: Option<Planned> = read_if_there(&folder.file("plan.json"))?;
    Ok(plan.map(|plan| Look::at(folder, &plan).state()))
}

/// The part of `plan.json` that is read.
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
    trunk_id: Option<String>,
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

/// A job of the plan, and its state.
struct Looked<'a> {
    id: JobId,
    /// `None` for a run, whose spec has it.
    label: Option<&'a str>,
    cost: f64,
    /// Parameters of the generator that it trains.
    params: Option<usize>,
    /// Whether it failed, or needs something that did.
    is_lost: bool,
    seen: Seen,
}

/// The state of every job, in the order of the plan.
struct Look<'a> {
    folder: &'a ResultsFolder,
    plan: &'a Planned,
    jobs: Vec<Looked<'a>>,
}

impl<'a> Look<'a> {
    /// Looks at every job; a finished run costs one look at whether its record is there.
    fn at(folder: &'a ResultsFolder, plan: &'a Planned) -> Self {
        let inputs: Vec<Seen> = plan.inputs.iter().map(|job| Seen::at(folder, &job.id)).collect();
        let runs: Vec<Seen> = plan.runs.par_iter().map(|run| Seen::at(folder, &run.id())).collect();
        let lost = lost(plan, &inputs, &runs);
        // A trunk has the generator of the runs that branch off it.
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

    /// The progress of the sweep.
    fn state(&self) -> SweepState {
        let (finished, mut warnings) = self.finished();
        let speed = known(self.folder, &finished);
        let left = |slots| speed.as_ref().map(|speed| self.seconds_left(speed, slots, &|_| true));
        let (failures, running) = (self.failures(&mut warnings), self.running());
        let mut inputs: BTreeMap<JobKind, Counts> = BTreeMap::new();
        for job in &self.jobs {
            inputs.entry(job.id.kind).or_default().add(job.seen, job.is_lost);
        }
        SweepState {
            at_work: presence::is_held(self.folder),
            scheduler: presence::scheduler(self.folder),
            runs: inputs.remove(&JobKind::Run).unwrap_or_default(),
            inputs,
            failures,
            warnings,
            flops_total: self.trained(|_| 1.0),
            flops_done: self.trained(Seen::done),
            job_seconds_left: left(1),
            eta_s: left(running.len()).filter(|_| !running.is_empty()),
            running,
        }
    }

    /// Seconds until the wanted jobs that can still be done are done on `slots` slots.
    fn seconds_left(&self, speed: &Speed, slots: usize, wanted: &dyn Fn(&JobId) -> bool) -> f64 {
        let to_do = self.jobs.iter().filter(|job| wanted(&job.id) && !job.is_lost);
        seconds_left(to_do.map(|job| speed.seconds(job.cost * job.seen.left(), job.params)), slots)
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

    /// The finished work, and problems of records.
    fn finished(&self) -> (Finished, Vec<String>) {
        let done = self.jobs.iter().filter(|job| job.seen == Seen::At(JobState::Done));
        let runs = done.filter(|job| job.id.kind == JobKind::Run);
        let runs: Vec<_> = runs.filter_map(|run| Some((run.params?, run.id.id.as_str()))).collect();
        Finished::read(self.folder, &runs, &self.plan.inputs)
    }
}

/// Failed jobs and their dependents; the plan is in order of dependency.
fn lost(plan: &Planned, inputs: &[Seen], runs: &[Seen]) -> HashSet<JobId> {
    let mut lost = HashSet::new();
    for (job, seen) in plan.inputs.iter().zip(inputs) {
        let orphan = seen.is_open() && job.needs.iter().any(|need| lost.contains(need));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::atomic::write_json;
    use crate::jobs::speed;
    use serde_json::json;
    use std::fs::{self, File};

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
            let beat = Beat { step: 1, steps: 4, loss: 2.0, train_s: 0.5, tokens_per_s: None };
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
        let tokens = state.inputs[&JobKind::Tokens];
        assert_eq!(tokens, Counts { missing: 1, blocked: 1, ..Counts::default() });
        assert_eq!(state.failures[0].reason, failure.reason);
        assert_eq!(state.failures[0].failure_kind, FailureKind::Diverged);
    }

    #[test]
    fn one_estimate_counts_tokenizers_and_checkpoints_right_after_a_resume() {
        let place = tempfile::tempdir().unwrap();
        let folder = planned(&place, 3);
        let all = |_: &JobId| true;
        assert_eq!(time_left(&folder, 1, &all).unwrap(), None, "nothing tells how fast runs are");
        speed::note(&folder, &Speed::new(vec![(1.0, 0.5)], 0.25)).unwrap();
        // Runs of 1, 2 and 3 FLOPs at a half a second; a tokenizer and its codes of 1 each at a quarter.
        let estimate = |slots| time_left(&folder, slots, &all).unwrap().unwrap();
        assert_eq!([estimate(1), estimate(2)], [12.0 + 8.0, 10.0]);
        assert_eq!(sweep_state(&folder).unwrap().unwrap().job_seconds_left, Some(20.0));
        let runs_alone = |id: &JobId| id.kind == JobKind::Run;
        assert_eq!(time_left(&folder, 1, &runs_alone).unwrap(), Some(12.0));
        // A run that was stopped half way, and is at work again.
        fs::create_dir_all(folder.run("2").join("checkpoint")).unwrap();
        let beat = Beat { step: 2, steps: 4, loss: 2.0, train_s: 0.0, tokens_per_s: None };
        crate::progress::note_progress(&folder.run("2"), &beat);
        let lock = File::create(folder.run("2").join(".lock")).unwrap();
        lock.try_lock().unwrap();
        let state = sweep_state(&folder).unwrap().unwrap();
        assert_eq!((state.eta_s, estimate(1)), (Some(17.0), 17.0));
    }
}
