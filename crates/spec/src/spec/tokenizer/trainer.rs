//! Which tokenizers the trainer in PyTorch can train.

use super::TokenizerSpec;
use crate::spec::architecture::ArchitectureSpec;
use crate::spec::error::{SpecError, require_all};
use crate::spec::quantizer::QuantizerSpec;

impl TokenizerSpec {
    /// The first setting that the trainer of the spec cannot follow.
    pub(super) fn check_trainer(&self) -> Result<(), SpecError> {
        if self.trainer.is_built_in() {
            return Ok(());
        }
        let patches = matches!(self.architecture, ArchitectureSpec::Patch(_));
        let residual = matches!(self.quantizer, QuantizerSpec::Residual(_));
        let mixes = self.training.mix_body > 0.0 || self.training.mix_arm > 0.0;
        require_all([
            (!patches, "trainer", "`torch` trains no patches: leave `trainer` out"),
            (!residual, "trainer", "`torch` trains no residual quantizers: leave `trainer` out"),
            (!mixes, "trainer", "`torch` mixes no bodies: set mix_body and mix_arm to 0"),
            (
                self.plateau.is_none(),
                "trainer",
                "`torch` takes all steps: leave tokenizer.plateau out",
            ),
        ])
    }
}
