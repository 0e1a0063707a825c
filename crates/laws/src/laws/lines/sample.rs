//! What a bootstrap replicate keeps of the laws, for intervals.

use super::types::FloorLaw;
use serde::{Deserialize, Serialize};

/// One bootstrap replicate: ln y at C0 and the exponent of each law, and the log loss law.
///
/// Where one vocabulary was tried the two vocabulary numbers follow the model's width alone. Where
/// N alone is known the non-vocabulary numbers are those of N, and the vocabulary numbers are 0 and
/// mean nothing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LawSample {
    pub ln_vocab_at_reference: f64,
    pub exponent_vocab: f64,
    pub ln_nonvocab_at_reference: f64,
    pub exponent_nonvocab: f64,
    pub ln_tokens_at_reference: f64,
    pub exponent_tokens: f64,
    pub loss_intercept: f64,
    pub loss_slope_per_decade: f64,
    /// Absent where the replicate had no floor law.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub floor: Option<FloorSample>,
}

/// The floor law of one bootstrap replicate, around the C0 of the fit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FloorSample {
    pub floor: f64,
    pub coefficient: f64,
    pub exponent: f64,
}

/// ln y at C0 and the exponent of each law.
impl LawSample {
    pub fn size(&self) -> (f64, f64) {
        (self.ln_nonvocab_at_reference, self.exponent_nonvocab)
    }

    pub fn vocab(&self) -> (f64, f64) {
        (self.ln_vocab_at_reference, self.exponent_vocab)
    }

    pub fn tokens(&self) -> (f64, f64) {
        (self.ln_tokens_at_reference, self.exponent_tokens)
    }
}

impl FloorSample {
    /// What a replicate keeps of its floor law.
    pub(in crate::laws) fn of(law: &FloorLaw) -> Self {
        Self { floor: law.floor, coefficient: law.coefficient, exponent: law.exponent }
    }

    /// L_u at C, in nats; `reference` is C0.
    pub fn loss_at(&self, compute: f64, reference: f64) -> f64 {
        self.floor + self.coefficient * (compute / reference).powf(-self.exponent)
    }
}
