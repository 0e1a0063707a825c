//! [`ScoreJob`]: a run whose motions are to be scored.

use serde::{Deserialize, Serialize};

use super::planned_run::PlannedRun;
use super::run_spec::TRAINING_REVISION;
use crate::spec::{ModelShape, ScoresSpec, content_id};
use crate::sweep::condition::Condition;

/// One run to score.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScoreJob {
    pub revision: u32,
    pub run_id: String,
    pub evaluator_id: String,
    /// Without its conditions, which choose runs and change none.
    pub spec: ScoresSpec,
}

impl ScoreJob {
    /// The score of a run by an evaluator.
    pub fn new(run_id: &str, evaluator_id: &str, spec: &ScoresSpec) -> Self {
        Self {
            revision: TRAINING_REVISION,
            run_id: run_id.to_string(),
            evaluator_id: evaluator_id.to_string(),
            spec: spec.of_a_run(),
        }
    }

    /// Content id: the hash of every field.
    pub fn id(&self) -> String {
        content_id(self)
    }

    /// The scores of those runs that a `scores` section chooses.
    pub fn of_runs(runs: &[PlannedRun], evaluator_id: &str, spec: &ScoresSpec) -> Vec<Self> {
        let conditions: Vec<Condition> =
            spec.only.iter().filter_map(|text| Condition::parse(text).ok()).collect();
        let chosen = |run: &&PlannedRun| {
            conditions.is_empty() || conditions.iter().any(|condition| holds(condition, run))
        };
        runs.iter().filter(chosen).map(|run| Self::new(&run.run_id, evaluator_id, spec)).collect()
    }
}

fn holds(condition: &Condition, PlannedRun { spec, .. }: &PlannedRun) -> bool {
    let ModelShape { n_layer, n_head, d_model, .. } = *spec.shape();
    let [n_layer, n_head, d_model, v] =
        [n_layer, n_head, d_model, spec.n_vocab()].map(|n| n as f64);
    condition.holds([n_layer, n_head, d_model, v, spec.budget_flops, spec.share.value()])
}
