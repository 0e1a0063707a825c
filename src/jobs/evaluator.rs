//! A trained evaluator and what it is worth.

use std::path::PathBuf;

use anyhow::Result;

use super::assignment::{Assignment, Outcome};
use super::folder::ResultsFolder;
use super::id::JobId;
use super::job::Job;
use super::kind::{JobKind, Kind};
use super::mend::train_past_damage;
use super::spec_file::write_once;
use crate::data::MotionSource;
use crate::evaluator::{self, EvaluatorError, EvaluatorReport, TrainedEvaluator};
use crate::files::atomic::write_json;
use crate::files::{FileError, read_if_there};
use crate::learn::{Checkpoints, step_of};
use crate::plan::{EvaluatorJob, Plan, evaluator_peak_bytes};
use crate::progress::beats;
use crate::sweep::Stage;

/// Trains an evaluator and measures its gates; they are written last.
pub struct Evaluator;

/// As a kind of job.
pub const KIND: JobKind = JobKind::from_static(&Evaluator);

impl Kind for Evaluator {
    fn word(&self) -> &'static str {
        "evaluator"
    }

    fn plural(&self) -> &'static str {
        "evaluators"
    }

    fn role(&self) -> &'static str {
        "its evaluator"
    }

    fn folder(&self, id: &str) -> PathBuf {
        PathBuf::from("evaluators").join(id)
    }

    fn product(&self) -> &'static str {
        "gates.json"
    }

    fn spec(&self, id: &str) -> PathBuf {
        self.folder(id).join("job.json")
    }

    fn stage(&self) -> Stage {
        Stage::Inputs
    }

    fn jobs(&self, plan: &Plan) -> Vec<Job> {
        let job = |job: &EvaluatorJob| Job {
            id: JobId::new(KIND, job.id()),
            label: "evaluator".to_string(),
            cost: job.spec.training_flops(),
            peak_bytes: evaluator_peak_bytes(&job.spec, &plan.data),
            needs: Vec::new(),
        };
        plan.evaluator.iter().map(job).collect()
    }

    fn prepare(
        &self,
        plan: &Plan,
        folder: &ResultsFolder,
        warn: &mut dyn FnMut(String),
    ) -> Result<(), FileError> {
        let write = |job: &EvaluatorJob| write_once(&folder.file(self.spec(&job.id())), job, warn);
        plan.evaluator.iter().try_for_each(write)
    }

    fn inspect(&self, folder: &ResultsFolder, id: &str) -> Result<(), FileError> {
        folder.gates(id).map(|_| ())
    }

    fn is_result(&self) -> bool {
        true
    }

    fn share_done(&self, folder: &ResultsFolder, id: &str) -> f64 {
        let job = JobId::new(KIND, id);
        let spec = read_if_there::<EvaluatorJob>(&folder.spec(&job)).ok().flatten();
        let share = |(step, job): (usize, EvaluatorJob)| step as f64 / job.spec.steps as f64;
        step_of(&folder.checkpoint(&job)).zip(spec).map_or(0.0, share)
    }

    fn work(&self, assignment: &Assignment) -> Result<Outcome> {
        let source = assignment.source()?;
        let job: EvaluatorJob = assignment.spec()?;
        let trained = trained(assignment, &job, &*source)?;
        let Some(TrainedEvaluator { evaluator, course }) = trained else {
            return Ok(Outcome::Stopped);
        };
        evaluator.save(&assignment.place())?;
        let gates = evaluator::measure(&evaluator, &*source)?;
        let report = EvaluatorReport {
            evaluator_id: assignment.job.id.clone(),
            n_parameters: evaluator.n_parameters(),
            verdicts: gates.verdicts(),
            passes: gates.pass(),
            spec: job.spec,
            data_digest: job.data_digest,
            course,
            gates,
        };
        write_json(&assignment.product(), &report)?;
        assignment.remove_checkpoint()?;
        Ok(Outcome::Done)
    }
}

/// Trains from the checkpoint, or from the beginning where that is damaged. `None`: stopped.
fn trained(
    assignment: &Assignment,
    job: &EvaluatorJob,
    source: &dyn MotionSource,
) -> Result<Option<TrainedEvaluator>> {
    let (path, every) = (assignment.checkpoint(), assignment.checkpoint_every()?);
    let checkpoints = Checkpoints { path: &path, every, branch: None };
    let place = assignment.place();
    let mut beats = beats(&place, assignment.stop);
    train_past_damage(&[&path], EvaluatorError::learn_error, || {
        evaluator::train(&job.spec, source, assignment.device, Some(&checkpoints), &mut beats)
    })
}
