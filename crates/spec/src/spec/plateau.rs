//! The end of a tokenizer's training at the plateau of the validation split.

use super::error::{SpecError, require};
use crate::units::section;

section! {
    /// The `tokenizer.plateau` section: the validation split is measured while a tokenizer is trained, the
    /// weights that were best on it are kept, and training ends where measurements bring nothing new.
    #[derive(Copy, Eq)]
    pub struct Plateau {
        /// Times that the validation split is measured, spread evenly over the steps.
        evaluations: usize = 20;
        /// Measurements in a row without a new best after which training ends.
        patience: usize = 5;
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
