//! [`ScoreJob`]: a run whose motions are to be scored.

use serde::{Deserialize, Serialize};

use super::planned_run::PlannedRun;
use super::run_spec::TRAINING_REVISION;
use crate::spec::{ScoresSpec, content_id};
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
    let shape = spec.shape();
    condition.holds(|field| match field {
        "n_layer" => shape.n_layer as f64,
        "n_head" => shape.n_head as f64,
        "d_model" => shape.d_model as f64,
        "n_vocab" => spec.n_vocab() as f64,
        _ => spec.budget_flops,
    })
}
