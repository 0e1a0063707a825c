//! [`PlannedRun`], a run with its id and cost, and the jobs of scores: [`EvaluatorJob`] and [`ScoreJob`].

use serde::{Deserialize, Serialize};

use crate::data::DataFacts;
use crate::spec::{
    EVALUATOR_REVISION, EvaluatorSpec, FlopsPerToken, ModelShape, ParamCounts, RunSpec, ScoresSpec,
    TRAINING_REVISION, content_id,
};
use crate::sweep::Condition;

/// One run of the plan.
#[derive(Clone, Debug)]
pub struct PlannedRun {
    pub run_id: String,
    pub spec: RunSpec,
    pub params: ParamCounts,
    pub flops_per_token: FlopsPerToken,
    pub achieved_ratio: f64,
    /// The cost for the built-in trainer.
    pub peak_bytes: u64,
    /// The trunk that it branches off; `None` if it is trained alone.
    pub trunk_id: Option<String>,
    /// Times that the run sees each token of the training split; `None` if it is not here.
    pub epochs: Option<f64>,
}

impl PlannedRun {
    /// Peak bytes of the run; `None` for a user's trainer, whose memory is unknown.
    pub fn known_peak_bytes(&self) -> Option<u64> {
        self.spec.trainer.is_none().then_some(self.peak_bytes)
    }

    /// FLOPs of the budget that the run's own job trains: all except its trunk's.
    pub fn own_flops(&self) -> f64 {
        let RunSpec { budget_flops, steps, decay_steps, .. } = self.spec;
        match (&self.trunk_id, decay_steps) {
            (Some(_), Some(decay)) => budget_flops * decay as f64 / steps as f64,
            _ => budget_flops,
        }
    }
}

// [`ScoreJob`]: a run whose motions are to be scored.

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
        let score = |run: &PlannedRun| Self {
            revision: TRAINING_REVISION,
            run_id: run.run_id.clone(),
            evaluator_id: evaluator_id.to_string(),
            spec: spec.of_a_run(),
        };
        runs.iter().filter(chosen).map(score).collect()
    }
}

fn holds(condition: &Condition, PlannedRun { spec, .. }: &PlannedRun) -> bool {
    let ModelShape { n_layer, n_head, d_model, .. } = *spec.shape();
    let [n_layer, n_head, d_model, v] =
        [n_layer, n_head, d_model, spec.n_vocab()].map(|n| n as f64);
    condition.holds([n_layer, n_head, d_model, v, spec.budget_flops, spec.share.value()])
}

// [`EvaluatorJob`]: an evaluator to train, which all scores of a sweep are taken by.

/// One evaluator to train. It depends only on the data, so sweeps that differ in anything else share it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluatorJob {
    pub revision: u32,
    pub spec: EvaluatorSpec,
    pub data_digest: String,
}

impl EvaluatorJob {
    /// The job of a sweep's `evaluator` section on its data.
    pub fn new(spec: EvaluatorSpec, data: &DataFacts) -> Self {
        Self { revision: EVALUATOR_REVISION, spec, data_digest: data.digest.clone() }
    }

    /// Content id: the hash of every field.
    pub fn id(&self) -> String {
        content_id(self)
    }
}
