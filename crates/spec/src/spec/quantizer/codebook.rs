//! [`CodebookSpec`]: the codes of one scale.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::spec::levels::{levels_for, n_codes, nominal_sizes};

/// Codes beyond which a codebook is taken for a slip of the pen.
const MOST_CODES: usize = 1 << 24;

/// A codebook, resolved: what is hashed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum CodebookSpec {
    /// Finite scalar quantization with so many levels in each dimension.
    Fsq { levels: Vec<usize> },
    /// Vector quantization, its codes learned by moving averages.
    Vq { n_vocab: usize },
}

/// A kind of codebook, as it is written in a sweep file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum CodebookKind {
    /// Vector quantization with moving averages and resets.
    #[default]
    Vq,
    /// Finite scalar quantization.
    Fsq,
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
    /// A problem that needs no help.
    pub(super) fn new(problem: impl Into<String>) -> Self {
        Self { problem: problem.into(), help: None }
    }
}

impl CodebookKind {
    /// The codebook of so many codes; for FSQ a size that ScaMo's Table 8 names, or its product.
    ///
    /// # Errors
    /// There is none.
    pub fn of_size(self, n: usize) -> Result<CodebookSpec, VocabularyError> {
        match self {
            Self::Vq => Ok(CodebookSpec::Vq { n_vocab: n }),
            Self::Fsq => {
                let levels = levels_for(n).ok_or_else(|| no_levels(n))?;
                Ok(CodebookSpec::Fsq { levels: levels.to_vec() })
            }
        }
    }

    /// The codebook of levels.
    ///
    /// # Errors
    /// VQ has no levels.
    pub fn of_levels(self, levels: &[usize]) -> Result<CodebookSpec, VocabularyError> {
        match self {
            Self::Fsq => Ok(CodebookSpec::Fsq { levels: levels.to_vec() }),
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

impl CodebookSpec {
    /// Codes: for FSQ the product of its levels.
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

    /// Nothing, if it makes codes.
    ///
    /// # Errors
    /// It has no code, too few, or too many to count.
    pub fn check(&self) -> Result<(), VocabularyError> {
        let levels = self.levels().unwrap_or(&[2]);
        let codes = match self {
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
            Ok(())
        }
    }
}
