//! [`Precision`]: the numbers that large products are computed in.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The numbers that large products are computed in.
///
/// Weights, moments, sums of squares, softmax and losses are in `f32` always, and so is every measure
/// on a split (mixed precision, Micikevicius et al. 2018).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// Single precision: what processors compute in.
    #[default]
    F32,
    /// 5 bits of exponent, 10 of fraction: losses are scaled up on the way back.
    F16,
    /// 8 bits of exponent, 7 of fraction.
    Bf16,
}

impl Precision {
    /// The word in a sweep.
    pub fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F16 => "f16",
            Self::Bf16 => "bf16",
        }
    }

    /// What the mean loss of so many targets is multiplied by before its gradients are taken, and
    /// they are divided by after: in `f16` about as many, so that a target's own share is not lost
    /// below 6e-8. A power of two, which rounds nothing.
    pub fn loss_scale(self, targets: usize) -> f64 {
        match self {
            Self::F16 => targets.next_power_of_two().min(MOST_SCALED) as f64,
            Self::F32 | Self::Bf16 => 1.0,
        }
    }
}

/// Above it, gradients by weights would come near the largest number of `f16`.
const MOST_SCALED: usize = 4096;
