//! [`Made`]: motions of captions, made by a run a batch at a time, of which only scores are kept.

use anyhow::Result;

use super::run_scores::ScoredPhysics;
use crate::evaluator::Evaluator;
use crate::generator::{Draw, Prompt, Sampling};
use crate::jobs::trained::TrainedRun;
use crate::motion::recover_joints;
use crate::progress::moved;
use crate::scores::{Embeddings, physics};
use crate::spec::ScoresSpec;

/// Motions that are made side by side.
const BATCH: usize = 64;

/// Motions that were made.
pub struct Made {
    pub motions: Embeddings,
    pub physics: ScoredPhysics,
}

/// Makes motions and embeds them.
///
/// # Errors
/// The run cannot make one, or the evaluator cannot embed it.
pub fn make(
    run: &TrainedRun,
    evaluator: &Evaluator,
    spec: &ScoresSpec,
    prompts: &[Prompt],
) -> Result<Made> {
    let (mut values, mut bodies) = (Vec::new(), Vec::new());
    for batch in prompts.chunks(BATCH) {
        let motions = decoded(run, spec, batch)?;
        let embedded = evaluator.motions(motions.iter().map(Vec::as_slice))?;
        values.extend(embedded.rows().flatten());
        let body = |motion: &Vec<f32>| physics(&recover_joints(motion), run.spec.fps).ok();
        bodies.extend(motions.iter().filter_map(body));
        moved();
    }
    let motions = Embeddings::new(values, evaluator.spec().dim)?;
    Ok(Made { motions, physics: ScoredPhysics::mean(&bodies) })
}

/// Features of motions that are made side by side.
///
/// # Errors
/// The run cannot make one.
pub fn decoded(run: &TrainedRun, spec: &ScoresSpec, prompts: &[Prompt]) -> Result<Vec<Vec<f32>>> {
    let made = run.motions(prompts, &sampling(run, spec), spec.detokenizer_guidance)?;
    Ok(made.into_iter().map(|motion| motion.features).collect())
}

/// How a run's motions are drawn.
fn sampling(run: &TrainedRun, spec: &ScoresSpec) -> Sampling {
    let ScoresSpec { temperature, top_k, top_p, rounds, .. } = *spec;
    let draw = Draw { temperature, top_k, top_p };
    Sampling { draw, guidance: guidance(run, spec), rounds }
}

/// The guidance that a run's generator is given: those that know none are given none.
pub fn guidance(run: &TrainedRun, spec: &ScoresSpec) -> f64 {
    if run.takes_guidance() { spec.guidance } else { 0.0 }
}
