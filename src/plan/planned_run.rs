//! [`PlannedRun`]: a run with its id and its price.

use super::run_spec::RunSpec;
use crate::spec::{FlopsPerToken, ParamCounts};

/// One run of the plan.
#[derive(Clone, Debug)]
pub struct PlannedRun {
    pub run_id: String,
    pub spec: RunSpec,
    pub params: ParamCounts,
    pub flops_per_token: FlopsPerToken,
    pub achieved_ratio: f64,
    /// What the built-in trainer takes.
    pub peak_bytes: u64,
    /// The trunk that it branches off; `None` where it is trained alone.
    pub trunk_id: Option<String>,
    /// Times that the run sees each token of the training split; `None` where it is not here.
    pub epochs: Option<f64>,
}

impl PlannedRun {
    /// Bytes at the run's peak; `None` where a trainer other than the built-in one takes what it takes.
    pub fn known_peak_bytes(&self) -> Option<u64> {
        self.spec.trainer.is_none().then_some(self.peak_bytes)
    }

    /// FLOPs of the budget that the run's own job trains: all but what its trunk does.
    pub fn own_flops(&self) -> f64 {
        match (&self.trunk_id, self.spec.decay_steps) {
            (Some(_), Some(decay)) => {
                self.spec.budget_flops * decay as f64 / self.spec.steps as f64
            }
            _ => self.spec.budget_flops,
        }
    }
}
