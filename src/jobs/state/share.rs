//! The share of its steps that the checkpoint of a job holds.

use crate::evaluator::OneScore;
use crate::files::read_if_there;
use crate::jobs::folder::CHECKPOINT;
use crate::jobs::score::repeats_file;
use crate::jobs::training::trunk_state;
use crate::jobs::{JobId, JobKind, ResultsFolder};
use crate::learn::step_of;
use crate::plan::{EvaluatorJob, ScoreJob, Trunk};
use crate::progress::progress;
use crate::spec::{RunSpec, TokenizerJob};
use crate::tokenizer::share_kept;

/// The share of its steps that a job's checkpoint holds; `None` if that cannot be told.
pub fn share_done(folder: &ResultsFolder, job: &JobId) -> Option<f64> {
    let of = |steps: usize| Some(step_of(&folder.checkpoint(job))? as f64 / steps as f64);
    match job.kind {
        JobKind::Text => None,
        JobKind::Tokenizer => of(folder.known_spec::<TokenizerJob>(job)?.spec.training.steps),
        JobKind::Tokens => Some(share_kept(&folder.job(job).join(CHECKPOINT))),
        JobKind::Trunk => {
            let trunk: Trunk = folder.known_spec(job)?;
            own_share(folder, job, &trunk.spec, trunk.from.as_deref())
        }
        JobKind::Run => {
            let spec: RunSpec = folder.known_spec(job)?;
            let trunk = spec.trunk().map(|trunk| trunk.id());
            // A program of somebody's own keeps its checkpoint to itself: what it last said stands for it.
            let told = || {
                let beat = progress(&folder.job(job)).filter(|_| spec.trainer.is_some())?;
                Some((beat.step as f64 / beat.steps.max(1) as f64).clamp(0.0, 1.0))
            };
            own_share(folder, job, &spec, trunk.as_deref()).or_else(told)
        }
        JobKind::Evaluator => of(folder.known_spec::<EvaluatorJob>(job)?.spec.steps),
        JobKind::Score => {
            let done: Vec<OneScore> = read_if_there(&repeats_file(folder, job)).ok().flatten()?;
            let repeats = folder.known_spec::<ScoreJob>(job)?.spec.repeats;
            Some(done.len() as f64 / repeats as f64)
        }
    }
}

/// The share of its own steps that a run's or a trunk's checkpoint holds, where it begins with the
/// trunk of an id.
fn own_share(
    folder: &ResultsFolder,
    job: &JobId,
    spec: &RunSpec,
    from: Option<&str>,
) -> Option<f64> {
    let step = step_of(&folder.checkpoint(job))?;
    let trunk = from.and_then(|id| trunk_state(folder, id));
    let before = trunk.filter(|(state, _)| state.exists()).map_or(0, |(_, steps)| steps);
    let [done, all] = [step, spec.steps].map(|end| end.saturating_sub(before) as f64);
    Some((done / all.max(1.0)).clamp(0.0, 1.0))
}
