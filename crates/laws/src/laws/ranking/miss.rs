//! [`Miss`]: what a law that saw smaller budgets alone said of a larger one, less what was measured there.

use crate::laws::joint::above::Off;
use serde::{Deserialize, Serialize};

/// A forecast of one budget of a sweep, against its measurement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Miss {
    /// How many budgets the law was fitted to.
    pub n_fitted: usize,
    /// What the runs of the budget saw of the data, the largest share of the sweep being 1.
    #[serde(default = "largest", skip_serializing_if = "is_largest")]
    pub share: f64,
    pub budget_flops: f64,
    /// The budget over the largest that was fitted.
    pub factor: f64,
    /// Loss error in nats: at the budget's minimum, or, for a joint law of several vocabularies, the mean over
    /// the cells near the minimum.
    pub loss: Off,
    /// Of the minimum; none where its place is in doubt, or where too few minima of smaller budgets are beyond
    /// it for a law through them. A joint law alone is tested there.
    pub minimum: Option<MissedMinimum>,
}

fn largest() -> f64 {
    1.0
}

fn is_largest(share: &f64) -> bool {
    *share == 1.0
}

/// A value for the loss, and one for the logarithm of each part of an allocation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Deviations<T = f64> {
    /// In nats.
    pub loss: f64,
    /// Of ln N_nv, or ln N.
    pub ln_size: T,
    /// Of ln N_v; 0 where N_v is not told apart.
    pub ln_vocab: T,
    /// Of ln D.
    pub ln_tokens: T,
}

/// Predicted less measured minimum.
pub type MissedMinimum = Deviations<Off>;
