//! [`QuantizerSpec`]: which quantizer, and its codebooks; [`Grid`]: the codes that it makes, between a tokenizer and
//! a generator. What a sweep file says of it is [`QuantizerSection`].

mod codebook;
mod section;

use serde::{Deserialize, Serialize};

use codebook::are_increasing;
pub use codebook::{
    CodebookKind, CodebookSpec, ScaleName, ScaleSpec, VocabularyError, digits_of_index,
    index_of_digits, levels_for, n_codes, nominal_sizes,
};
pub use section::{QuantizerKind, QuantizerSection};

/// A quantizer, resolved for hashing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum QuantizerSpec {
    /// Finite scalar quantization with so many levels in each dimension.
    Fsq { levels: Vec<usize> },
    /// Vector quantization, its codebook learned by moving averages.
    Vq { n_vocab: usize },
    /// Codebooks in sequence, each for the residual of the previous ones.
    Residual(ResidualSpec),
    /// Codebooks of several lengths, each for the residual of the previous ones.
    Multiscale(MultiscaleSpec),
}

/// The sizes of a residual quantizer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResidualSpec {
    /// Codebooks, one code of each for a latent.
    pub layers: usize,
    /// The kind of each.
    pub codebook: CodebookSpec,
    /// Probability that a training step uses only a random number of the first layers.
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

impl Default for QuantizerSpec {
    fn default() -> Self {
        Self::Fsq { levels: vec![8, 6, 5] }
    }
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
        let codebooks = self.codebooks();
        let lengths = match self {
            Self::Multiscale(own) => own.scales.iter().copied().map(Length::Codes).collect(),
            _ => vec![Length::FramesPerCode(frames_per_latent); codebooks.len()],
        };
        let scale =
            |(codebook, length): (CodebookSpec, _)| Scale { n_vocab: codebook.n_vocab(), length };
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

    /// The latents of the longest scale of a fixed length; 0 if there is none.
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
            Self::Multiscale(own) if !are_increasing(&own.scales) => {
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

// [`Grid`]: the codes between a tokenizer and a generator.

/// The codes that a tokenizer gives a clip: one or more scales, and whether an end token follows.
///
/// Codes of a clip stand scale after scale. ScaMo's stream is one scale with an end token; residual
/// codes are several scales of one length; multi-scale codes are several scales of fixed lengths.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Grid {
    /// At least one.
    pub scales: Vec<Scale>,
    /// Whether a clip ends with an end token, which a generator predicts after its last code.
    pub end_token: bool,
}

/// Codes of one codebook.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Scale {
    /// Codes of the codebook, without special tokens (V).
    pub n_vocab: usize,
    pub length: Length,
}

/// The number of codes of a clip on a scale.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Length {
    /// One for so many frames; frames that are left over are not encoded.
    FramesPerCode(usize),
    /// So many, however long the clip is.
    Codes(usize),
}

impl Grid {
    /// One scale with an end token.
    pub fn stream(n_vocab: usize, frames_per_code: usize) -> Self {
        let length = Length::FramesPerCode(frames_per_code);
        Self { scales: vec![Scale { n_vocab, length }], end_token: true }
    }

    /// V, the codes of all codebooks together.
    pub fn n_vocab(&self) -> usize {
        self.scales.iter().map(|scale| scale.n_vocab).sum()
    }

    /// The codes of the codebooks before each scale's own: what an id of a scale is moved by where all
    /// codebooks stand in one vocabulary.
    pub fn offsets(&self) -> impl Iterator<Item = usize> {
        self.scales.iter().scan(0, |before, scale| {
            let own = *before;
            *before += scale.n_vocab;
            Some(own)
        })
    }

    /// The codes of each scale of a clip of so many frames.
    pub fn lengths(&self, n_frames: usize) -> impl Iterator<Item = usize> {
        self.scales.iter().map(move |scale| scale.length.codes(n_frames))
    }

    /// The codes of a clip of so many frames.
    pub fn n_codes(&self, n_frames: usize) -> usize {
        self.lengths(n_frames).sum()
    }

    /// The targets of a clip by frames: its codes and the end token.
    pub fn n_targets(&self, n_frames: usize) -> usize {
        self.n_codes(n_frames) + usize::from(self.end_token)
    }

    /// Frames covered by a number of codes of the first scale; `None` if that depends on the clip.
    pub fn frames_of(&self, n_first: usize) -> Option<usize> {
        match self.scales.first()?.length {
            Length::FramesPerCode(frames) => Some(frames * n_first),
            Length::Codes(_) => None,
        }
    }

    /// Frames per code, over all scales; `None` if that depends on the clip.
    pub fn frames_per_code(&self) -> Option<f64> {
        let per_frame = self.scales.iter().map(|scale| match scale.length {
            Length::FramesPerCode(frames) => Some(1.0 / frames as f64),
            Length::Codes(_) => None,
        });
        Some(1.0 / per_frame.sum::<Option<f64>>()?)
    }
}

impl Scale {
    /// Whether it has codes that can be counted, and one stands for a frame or more.
    pub fn is_sound(&self) -> bool {
        let most = u32::MAX as usize;
        let is_length = match self.length {
            Length::FramesPerCode(frames) => frames > 0,
            Length::Codes(codes) => codes <= most,
        };
        is_length && (1..=most).contains(&self.n_vocab)
    }
}

impl Length {
    fn codes(self, n_frames: usize) -> usize {
        match self {
            Self::FramesPerCode(frames) => n_frames / frames,
            Self::Codes(codes) => codes,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scales(scales: &[(usize, Length)], end_token: bool) -> Grid {
        let scales = scales.iter().map(|&(n_vocab, length)| Scale { n_vocab, length }).collect();
        Grid { scales, end_token }
    }

    #[test]
    fn a_stream_has_a_code_for_four_frames_and_an_end_token() {
        let stream = Grid::stream(240, 4);
        assert_eq!((stream.n_codes(199), stream.n_targets(199)), (49, 50));
        assert_eq!((stream.n_vocab(), stream.frames_per_code()), (240, Some(4.0)));
    }

    #[test]
    fn residual_scales_have_one_length_and_multiple_scales_their_own() {
        let residual = scales(&[(512, Length::FramesPerCode(4)); 6], false);
        assert_eq!((residual.n_codes(196), residual.n_targets(196)), (294, 294));
        assert_eq!((residual.n_vocab(), residual.frames_per_code()), (3072, Some(4.0 / 6.0)));
        let full = [3, 6, 10, 15, 20, 25, 30, 36, 42, 49].map(|codes| (256, Length::Codes(codes)));
        let multiple = scales(&full, false);
        assert_eq!([40, 196].map(|frames| multiple.n_codes(frames)), [236, 236]);
        assert_eq!(multiple.frames_per_code(), None);
        assert_eq!(multiple.offsets().collect::<Vec<_>>()[..3], [0, 256, 512]);
    }
}
