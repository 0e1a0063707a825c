//! A trained evaluator and what it is worth.

use anyhow::Result;

use super::assignment::{Assignment, Outcome};
use super::mend::train_past_damage;
use crate::evaluator::{self, EvaluatorError, EvaluatorReport, TrainedEvaluator};
use crate::files::atomic::write_json;
use crate::learn::Checkpoints;
use crate::plan::EvaluatorJob;
use crate::progress::beats;

/// Trains an evaluator, from the checkpoint if that is whole, and measures its gates; they are written last.
pub fn work(assignment: &Assignment) -> Result<Outcome> {
    let source = assignment.source()?;
    let EvaluatorJob { spec, data_digest, .. } = assignment.spec()?;
    let (path, every) = (assignment.checkpoint(), assignment.checkpoint_every()?);
    let checkpoints = Checkpoints { path: &path, every, branch: None };
    let place = assignment.place();
    let mut beats = beats(&place, assignment.stop);
    let trained = train_past_damage(&[&path], EvaluatorError::learn_error, || {
        evaluator::train(&spec, &*source, assignment.device, Some(&checkpoints), &mut beats)
    })?;
    let Some(TrainedEvaluator { evaluator, course }) = trained else {
        return Ok(Outcome::Stopped);
    };
    evaluator.save(&place)?;
    let gates = evaluator::measure(&evaluator, &*source)?;
    let report = EvaluatorReport {
        evaluator_id: assignment.job.id.clone(),
        n_parameters: evaluator.n_parameters(),
        verdicts: gates.verdicts(),
        passes: gates.pass(),
        spec,
        data_digest,
        course,
        gates,
    };
    write_json(&assignment.product(), &report)?;
    assignment.done()
}
