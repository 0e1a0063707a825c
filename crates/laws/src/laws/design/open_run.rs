//! [`OpenRun`]: a run that could be trained.

use crate::laws::input::point::IsoFlopPoint;
use crate::laws::joint::loss::Place;

/// A run that could be trained.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenRun {
    /// The declared budget.
    pub budget_flops: f64,
    /// What training it costs.
    pub flops: f64,
    pub params_nonvocab: f64,
    pub n_vocab: f64,
    pub tokens: f64,
    /// Distinct tokens of the training split, where they are known.
    pub unique_tokens: Option<f64>,
}

impl OpenRun {
    /// A run that is trained, as it was before.
    pub fn of(point: &IsoFlopPoint) -> Self {
        Self {
            budget_flops: point.budget_flops,
            flops: point.flops,
            params_nonvocab: point.params_nonvocab,
            n_vocab: point.n_vocab,
            tokens: point.tokens,
            unique_tokens: point.about.unique_tokens,
        }
    }

    pub(super) fn place(&self) -> Place {
        Place::new([self.params_nonvocab, self.n_vocab, self.tokens], self.unique_tokens)
    }
}
