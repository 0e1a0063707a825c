//! [`QuantizerSpec`]: which quantizer, and its codebooks. What a sweep file says of it is
//! [`QuantizerSection`].

mod codebook;
mod scales;
mod section;

use serde::{Deserialize, Serialize};

pub use codebook::{CodebookKind, CodebookSpec, VocabularyError};
pub use scales::{ScaleName, ScaleSpec};
pub use section::{QuantizerKind, QuantizerSection};

use super::grid::{Grid, Length, Scale};

/// A quantizer, resolved: what is hashed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum QuantizerSpec {
    /// Finite scalar quantization with so many levels in each dimension.
    Fsq { levels: Vec<usize> },
    /// Vector quantization, its codebook learned by moving averages.
    Vq { n_vocab: usize },
    /// Codebooks after one another, each of what those before it leave over.
    Residual(ResidualSpec),
    /// Codebooks of several lengths, each of what those before it leave over.
    Multiscale(MultiscaleSpec),
}

/// The sizes of a residual quantizer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResidualSpec {
    /// Codebooks, one code of each for a latent.
    pub layers: usize,
    /// What each of them is.
    pub codebook: CodebookSpec,
    /// How often a training step uses only the first layers, a random number of them.
    pub dropout: f64,
}

/// The sizes of a multi-scale quantizer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MultiscaleSpec {
    /// Codes of each scale, the coarsest first.
    pub scales: Vec<usize>,
    /// The codebook of each scale.
    pub codebooks: Vec<CodebookSpec>,
    /// Whether VQ compares directions (cosine) and not places (Euclid).
    pub cosine: bool,
    /// Weight of the term that draws latents to their codes, beside the one that draws codes to latents.
    pub beta: f64,
    /// Share of a convolution in what a scale adds (VAR); `None` for LG-Tok's two with ReLU.
    pub mix: Option<f64>,
}

impl QuantizerSpec {
    /// The quantizer of one codebook.
    pub fn of_codebook(codebook: CodebookSpec) -> Self {
        match codebook {
            CodebookSpec::Fsq { levels } => Self::Fsq { levels },
            CodebookSpec::Vq { n_vocab } => Self::Vq { n_vocab },
        }
    }

    /// `fsq`, `vq`, `residual` or `multiscale`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Fsq { .. } => "fsq",
            Self::Vq { .. } => "vq",
            Self::Residual(_) => "residual",
            Self::Multiscale(_) => "multiscale",
        }
    }

    /// Its codebooks, one a scale.
    pub fn codebooks(&self) -> Vec<CodebookSpec> {
        match self {
            Self::Fsq { levels } => vec![CodebookSpec::Fsq { levels: levels.clone() }],
            Self::Vq { n_vocab } => vec![CodebookSpec::Vq { n_vocab: *n_vocab }],
            Self::Residual(own) => vec![own.codebook.clone(); own.layers],
            Self::Multiscale(own) => own.codebooks.clone(),
        }
    }

    /// The codes that it makes of latents that stand for so many frames each.
    pub fn grid(&self, frames_per_latent: usize) -> Grid {
        let every = |_| Length::FramesPerCode(frames_per_latent);
        let scale =
            |(codebook, length): (CodebookSpec, _)| Scale { n_vocab: codebook.n_vocab(), length };
        let codebooks = self.codebooks();
        let lengths: Vec<Length> = match self {
            Self::Multiscale(own) => own.scales.iter().copied().map(Length::Codes).collect(),
            _ => (0..codebooks.len()).map(every).collect(),
        };
        Grid {
            scales: codebooks.into_iter().zip(lengths).map(scale).collect(),
            end_token: matches!(self, Self::Fsq { .. } | Self::Vq { .. }),
        }
    }

    /// Codes of all codebooks together (V): for FSQ the product of its levels.
    pub fn n_vocab(&self) -> usize {
        self.codebooks().iter().map(CodebookSpec::n_vocab).sum()
    }

    /// The levels of FSQ, which all codebooks of a quantizer share.
    pub fn levels(&self) -> Option<&[usize]> {
        match self {
            Self::Fsq { levels } => Some(levels),
            Self::Vq { .. } => None,
            Self::Residual(own) => own.codebook.levels(),
            Self::Multiscale(own) => own.codebooks.first()?.levels(),
        }
    }

    /// The latents of the longest scale of a fixed length; 0 where there is none.
    pub fn longest_scale(&self) -> usize {
        match self {
            Self::Multiscale(own) => own.scales.iter().copied().max().unwrap_or(0),
            _ => 0,
        }
    }

    /// Multiply-adds of a latent in the convolutions of all scales, forward.
    pub fn products_per_latent(&self, code_dim: usize) -> f64 {
        let Self::Multiscale(own) = self else { return 0.0 };
        let convolutions = own.scales.len() * if own.mix.is_some() { 1 } else { 2 };
        (convolutions * 3 * code_dim * code_dim) as f64
    }

    /// The same, if it makes codebooks.
    ///
    /// # Errors
    /// A codebook has no code, too few, or too many to count; there is no codebook, or not one a scale.
    pub fn checked(self) -> Result<Self, VocabularyError> {
        match &self {
            Self::Residual(own) if own.layers == 0 => {
                return Err(VocabularyError::new("no layer, so no code"));
            }
            Self::Residual(own) => own.codebook.check()?,
            Self::Multiscale(own) if !scales::are_increasing(&own.scales) => {
                return Err(VocabularyError::new(
                    "scales are one or more, each longer than the last",
                ));
            }
            Self::Multiscale(own) if own.scales.len() != own.codebooks.len() => {
                return Err(VocabularyError::new("each scale has one codebook"));
            }
            _ => self.codebooks().iter().try_for_each(CodebookSpec::check)?,
        }
        Ok(self)
    }
}

#[cfg(test)]
mod tests;
