//! [`QuantizerSpec`]: which quantizer, and its size.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::grid::Grid;
use super::levels::{levels_for, n_codes, nominal_sizes};

/// Codes beyond which a codebook is taken for a slip of the pen.
const MOST_CODES: usize = 1 << 24;

/// A quantizer, resolved: what is hashed.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum QuantizerSpec {
    /// Finite scalar quantization with so many levels in each dimension.
    Fsq { levels: Vec<usize> },
    /// Vector quantization, its codebook learned by moving averages.
    Vq { n_vocab: usize },
}

/// A kind of quantizer, as it is written in a sweep file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum QuantizerKind {
    /// Finite scalar quantization (Mentzer et al. 2023), ScaMo's.
    #[default]
    Fsq,
    /// Vector quantization with moving averages and resets, T2M-GPT's.
    Vq,
}

/// Why a vocabulary is none of a kind of quantizer.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{problem}")]
pub struct VocabularyError {
    pub problem: String,
    /// How to mend it.
    pub help: Option<String>,
}

impl VocabularyError {
    fn new(problem: impl Into<String>) -> Self {
        Self { problem: problem.into(), help: None }
    }
}

impl QuantizerKind {
    /// The quantizer of so many codes; for FSQ a size that ScaMo's Table 8 names, or its product.
    ///
    /// # Errors
    /// There is none.
    pub fn of_size(self, n: usize) -> Result<QuantizerSpec, VocabularyError> {
        let spec = match self {
            Self::Vq => QuantizerSpec::Vq { n_vocab: n },
            Self::Fsq => {
                let levels = levels_for(n).ok_or_else(|| no_levels(n))?;
                QuantizerSpec::Fsq { levels: levels.to_vec() }
            }
        };
        spec.checked()
    }

    /// The quantizer of levels.
    ///
    /// # Errors
    /// The kind has no levels, or these make no codebook.
    pub fn of_levels(self, levels: &[usize]) -> Result<QuantizerSpec, VocabularyError> {
        match self {
            Self::Fsq => QuantizerSpec::Fsq { levels: levels.to_vec() }.checked(),
            Self::Vq => {
                Err(VocabularyError::new("levels belong to `kind: fsq`; vq wants a number"))
            }
        }
    }
}

fn no_levels(n: usize) -> VocabularyError {
    let known: Vec<String> = nominal_sizes().map(|n| n.to_string()).collect();
    let help = format!("one of {}, or {{levels: [8, 4, 4]}}", known.join(", "));
    VocabularyError { problem: format!("ScaMo gives no levels for {n} codes"), help: Some(help) }
}

impl QuantizerSpec {
    /// `fsq` or `vq`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Fsq { .. } => "fsq",
            Self::Vq { .. } => "vq",
        }
    }

    /// The codes that it makes of latents that stand for so many frames each.
    pub fn grid(&self, frames_per_latent: usize) -> Grid {
        Grid::stream(self.n_vocab(), frames_per_latent)
    }

    /// Codes (V): for FSQ the product of its levels.
    pub fn n_vocab(&self) -> usize {
        match self {
            Self::Fsq { levels } => n_codes(levels),
            Self::Vq { n_vocab } => *n_vocab,
        }
    }

    /// The levels of FSQ.
    pub fn levels(&self) -> Option<&[usize]> {
        match self {
            Self::Fsq { levels } => Some(levels),
            Self::Vq { .. } => None,
        }
    }

    /// The same, if it makes a codebook.
    ///
    /// # Errors
    /// It has no code, too few, or too many to count.
    pub fn checked(self) -> Result<Self, VocabularyError> {
        let levels = self.levels().unwrap_or(&[2]);
        let codes = match &self {
            Self::Fsq { levels } => levels.iter().try_fold(1usize, |n, l| n.checked_mul(*l)),
            Self::Vq { n_vocab } => Some(*n_vocab),
        };
        if levels.is_empty() {
            Err(VocabularyError::new("no level, so no code"))
        } else if levels.iter().any(|level| *level < 2) {
            Err(VocabularyError::new("a level holds at least 2 values"))
        } else if codes.is_none_or(|codes| codes > MOST_CODES) {
            Err(VocabularyError::new(format!("more than {MOST_CODES} codes")))
        } else if codes.is_some_and(|codes| codes < 2) {
            Err(VocabularyError::new("a vocabulary holds at least 2 codes"))
        } else {
            Ok(self)
        }
    }
}
