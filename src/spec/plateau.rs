//! The end of a tokenizer's training at the plateau of the validation split.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::{SpecError, require};
use crate::units::number;

/// The `tokenizer.plateau` section: the validation split is measured while a tokenizer is trained, the
/// weights that were best on it are kept, and training ends where measurements bring nothing new.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Plateau {
    /// Times that the validation split is measured, spread evenly over the steps.
    #[serde(deserialize_with = "number::count")]
    pub evaluations: usize,
    /// Measurements in a row without a new best after which training ends.
    #[serde(deserialize_with = "number::count")]
    pub patience: usize,
}

impl Default for Plateau {
    fn default() -> Self {
        Self { evaluations: 20, patience: 5 }
    }
}

impl Plateau {
    /// The first setting that no training of so many steps can use.
    pub(super) fn check(&self, steps: usize) -> Result<(), SpecError> {
        let evaluated = (1..=steps).contains(&self.evaluations);
        require(evaluated, "plateau.evaluations", "lies between 1 and the steps")?;
        require(self.patience > 0, "plateau.patience", "must be at least 1")
    }
}
