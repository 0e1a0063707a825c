//! [`QuantizerSpec`]: which quantizer, and its size.

use serde::{Deserialize, Serialize};

use super::levels;

/// Which quantizer, and its size.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum QuantizerSpec {
    /// Finite scalar quantization with so many levels in each dimension.
    Fsq { levels: Vec<usize> },
    /// Vector quantization, its codebook learned by moving averages.
    Vq { n_vocab: usize },
}

impl QuantizerSpec {
    /// `fsq` or `vq`.
    pub fn name(&self) -> &'static str {
        match self {
            QuantizerSpec::Fsq { .. } => "fsq",
            QuantizerSpec::Vq { .. } => "vq",
        }
    }

    /// Codes (V): for FSQ the product of its levels.
    pub fn n_vocab(&self) -> usize {
        match self {
            QuantizerSpec::Fsq { levels } => levels::n_codes(levels),
            QuantizerSpec::Vq { n_vocab } => *n_vocab,
        }
    }

    /// The levels of FSQ.
    pub fn levels(&self) -> Option<&[usize]> {
        match self {
            QuantizerSpec::Fsq { levels } => Some(levels),
            QuantizerSpec::Vq { .. } => None,
        }
    }
}
