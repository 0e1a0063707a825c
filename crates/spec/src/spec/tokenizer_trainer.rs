//! [`TokenizerTrainer`]: who trains a tokenizer.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Who trains the tokenizers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TokenizerTrainer {
    /// The trainer inside isoflop.
    #[default]
    BuiltIn,
    /// The trainer in PyTorch that comes with isoflop, on a GPU if PyTorch sees one. It trains
    /// convolutional and transformer tokenizers with FSQ, VQ or several scales.
    Torch,
}

impl TokenizerTrainer {
    /// Whether it is the default, which specs and ids leave out.
    pub fn is_built_in(&self) -> bool {
        *self == Self::BuiltIn
    }
}
