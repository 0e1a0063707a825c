//! [`ArchitectureSpec`]: which network turns features into latents and back.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::transformer::{LanguageSpec, TransformerSpec};
use crate::spec::{SpecError, require};
use crate::units::number::plain;

plain!(Codes);

/// An architecture of a tokenizer, resolved for hashing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum ArchitectureSpec {
    /// T2M-GPT's convolutional autoencoder, which ScaMo keeps.
    Convolutional(ConvolutionalSpec),
    /// Patches of whole frames, one latent each.
    Patch(PatchSpec),
    /// A transformer over text, latents and motion (LG-Tok).
    Transformer(TransformerSpec),
}

/// The sizes of the convolutional autoencoder.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ConvolutionalSpec {
    /// Channels of every hidden layer; 512 in T2M-GPT and ScaMo.
    pub width: usize,
    /// Residual blocks at each resolution; 3 there.
    pub depth: usize,
    /// Halvings of the frame rate; 2 there, so 4 frames a latent.
    pub down: usize,
}

/// The sizes of the autoencoder of patches.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PatchSpec {
    /// Channels of every hidden layer.
    pub width: usize,
    /// Frames of a patch.
    pub frames: usize,
    /// Channels of a latent.
    pub latent: usize,
    /// Residual blocks before the quantizer; with 0, a latent depends only on its own frames.
    pub encoder_blocks: usize,
    /// Residual blocks after the quantizer.
    pub decoder_blocks: usize,
    /// Patches that k-means begins a code from, on average.
    pub patches_per_code: usize,
    #[serde(skip_serializing_if = "crate::units::is_default")]
    pub codes: Codes,
}

/// Whether the codes of patches move after k-means has placed them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Codes {
    /// They follow the encoder, which training changes.
    #[default]
    Learned,
    /// Codes stay at the k-means centres of the patches' principal components, and only the decoder is trained.
    /// A code depends only on its own frames, and vocabularies differ only in size, however long training takes.
    Fixed,
}

/// Patches of training clips that weights begin from, and learned codes at least.
const BEGUN_FROM: usize = 1 << 15;

/// Number of training patches to initialise a tokenizer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BegunFrom {
    /// For the weights before and after the quantizer.
    pub weights: usize,
    /// For its codes.
    pub codes: usize,
}

impl Default for PatchSpec {
    fn default() -> Self {
        let (width, frames, latent) = (128, 4, 32);
        let (encoder_blocks, decoder_blocks, patches_per_code) = (3, 4, 48);
        let codes = Codes::Learned;
        Self { width, frames, latent, encoder_blocks, decoder_blocks, patches_per_code, codes }
    }
}

impl Default for ConvolutionalSpec {
    fn default() -> Self {
        Self { width: 64, depth: 3, down: 2 }
    }
}

impl Default for ArchitectureSpec {
    fn default() -> Self {
        Self::Convolutional(ConvolutionalSpec::default())
    }
}

/// FLOPs of a training frame as a multiple of width², so counted that they take as long as those of
/// a run: a step of 2048 frames at width 64 takes as long as 1.3e9 FLOPs of a small model.
const FLOPS_PER_FRAME_AND_WIDTH_SQUARED: f64 = 150.0;

impl ArchitectureSpec {
    /// The word in files: `convolutional`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Convolutional(_) => "convolutional",
            Self::Patch(_) => "patch",
            Self::Transformer(_) => "transformer",
        }
    }

    /// Frames of a latent, or, if a clip has a fixed number of latents, frames that clips are cut to multiples of.
    pub fn stride(&self) -> usize {
        match self {
            Self::Convolutional(ConvolutionalSpec { down, .. }) => 1 << down,
            Self::Patch(PatchSpec { frames, .. }) => *frames,
            Self::Transformer(TransformerSpec { frames, .. }) => *frames,
        }
    }

    /// The latents of a clip of any length up to a window; `None` if they follow its length.
    pub fn fixed_latents(&self) -> Option<usize> {
        let Self::Transformer(sizes) = self else { return None };
        sizes.latents
    }

    /// Latents of a frame of the longest window.
    pub(super) fn latents_per_frame(&self) -> f64 {
        match self {
            Self::Transformer(sizes) => sizes.latents_per_frame(),
            _ => 1.0 / self.stride() as f64,
        }
    }

    /// Channels of a latent.
    pub fn code_dim(&self) -> usize {
        match self {
            Self::Convolutional(ConvolutionalSpec { width, .. }) => *width,
            Self::Patch(PatchSpec { latent, .. }) => *latent,
            Self::Transformer(TransformerSpec { latent, .. }) => *latent,
        }
    }

    /// Whether it sees joints at their height above the root.
    pub fn has_relative_heights(&self) -> bool {
        matches!(self, Self::Patch(_) | Self::Transformer(_))
    }

    /// Whether its codes move after they are placed.
    pub fn codes(&self) -> Codes {
        let Self::Patch(sizes) = self else { return Codes::Learned };
        sizes.codes
    }

    /// The halves that read a caption; `None` if neither does.
    pub fn language(&self) -> Option<&LanguageSpec> {
        let Self::Transformer(sizes) = self else { return None };
        sizes.language.as_ref()
    }

    /// The shortest training windows, as a share of the longest: those of a step are of one length,
    /// redrawn for each.
    pub fn shortest_window(&self) -> f64 {
        // Clips of any length are met at use, and attention has to know them.
        if matches!(self, Self::Transformer(_)) { 0.25 } else { 1.0 }
    }

    /// FLOPs that training on a frame counts for, beside the budgets of runs.
    pub fn flops_per_frame(&self) -> f64 {
        match self {
            Self::Convolutional(ConvolutionalSpec { width, .. }) => {
                FLOPS_PER_FRAME_AND_WIDTH_SQUARED * (*width as f64).powi(2)
            }
            Self::Patch(sizes) => sizes.flops_per_frame(),
            Self::Transformer(sizes) => sizes.flops_per_frame(),
        }
    }

    /// Bytes that the backward pass keeps of a frame of a step.
    ///
    /// Measured for the convolutions at depths 1 to 6 and 8 to 128 windows a step, within 20 %.
    pub fn training_bytes_per_frame(&self) -> f64 {
        match self {
            Self::Convolutional(ConvolutionalSpec { width, depth, .. }) => {
                *width as f64 * (152.0 + 46.0 * *depth as f64)
            }
            Self::Patch(sizes) => sizes.training_bytes_per_frame(),
            Self::Transformer(sizes) => sizes.training_bytes_per_frame(),
        }
    }

    /// Bytes that encoding a frame takes.
    pub fn encoding_bytes_per_frame(&self) -> f64 {
        match self {
            Self::Convolutional(ConvolutionalSpec { width, .. }) => 180.0 * *width as f64,
            Self::Patch(PatchSpec { width, .. }) => 180.0 * *width as f64,
            Self::Transformer(sizes) => sizes.encoding_bytes_per_frame(),
        }
    }

    /// The first field that no training can use.
    pub(super) fn check(&self) -> Result<(), SpecError> {
        match self {
            Self::Convolutional(_) => Ok(()),
            Self::Patch(PatchSpec { frames, .. }) => {
                require([1, 2, 4].contains(frames), "frames", "must be 1, 2 or 4")
            }
            Self::Transformer(sizes) => sizes.check(),
        }
    }
}

impl PatchSpec {
    /// Patches of training clips that weights and `n_codes` codes of k-means begin from, where the pool
    /// has as many.
    pub(super) fn begun_from(&self, n_codes: usize) -> BegunFrom {
        let wanted = self.patches_per_code * n_codes;
        let codes = if self.codes == Codes::Learned { wanted.max(BEGUN_FROM) } else { wanted };
        BegunFrom { weights: BEGUN_FROM, codes }
    }

    /// Multiply-adds of a patch in both halves, beside the features that are none of the joints'.
    fn products(&self) -> f64 {
        let Self { width, frames, latent, encoder_blocks, decoder_blocks, .. } = self;
        let (w, k, s) = (*width as f64, *latent as f64, *frames as f64);
        let blocks = (encoder_blocks + decoder_blocks) as f64;
        let (seen, all) = (67.0 * s, 263.0 * s);
        blocks * 4.0 * w * w + w * (seen + 2.0 * k + all) + 2.0 * k * all
    }

    fn flops_per_frame(&self) -> f64 {
        6.0 * self.products() / self.frames as f64
    }

    fn training_bytes_per_frame(&self) -> f64 {
        let blocks = (self.encoder_blocks + self.decoder_blocks) as f64;
        4.0 * (12.0 * 263.0 + blocks * 14.0 * self.width as f64 / self.frames as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::tokenizer::training::with;
    use crate::spec::{CodebookSpec, QuantizerSpec, TextSpec, TokenizerKind, TokenizerSection};

    #[test]
    fn codes_of_a_large_vocabulary_begin_from_as_many_patches_as_those_of_a_small_one() {
        let begun = |kind, codes, codebook| {
            let section = with(|s| (s.kind, s.codes) = (kind, codes));
            let quantizer = QuantizerSpec::of_codebook(codebook);
            let spec = section.spec(quantizer, &TextSpec::default());
            spec.begun_from().map(|begun| begun.codes)
        };
        let vq = |n_vocab| CodebookSpec::Vq { n_vocab };
        let of_vq = |codes| [64, 1024, 40_000].map(|n| begun(TokenizerKind::Patch, codes, vq(n)));
        assert_eq!(of_vq(None), [1 << 15, 48 * 1024, 48 * 40_000].map(Some));
        assert_eq!(of_vq(Some(Codes::Fixed)), [48 * 64, 48 * 1024, 48 * 40_000].map(Some));
        // FSQ places no codes, and a convolutional one begins from no data.
        let fsq = CodebookSpec::Fsq { levels: vec![8, 8, 8, 8] };
        assert_eq!(begun(TokenizerKind::Patch, None, fsq), Some(1 << 15));
        assert_eq!(begun(TokenizerKind::Vq, None, vq(1024)), None);
    }

    #[test]
    fn what_learns_codes_is_no_key_of_fixed_ones() {
        let fixed = |change: fn(&mut TokenizerSection)| {
            let mut section =
                with(|s| (s.kind, s.codes) = (TokenizerKind::Patch, Some(Codes::Fixed)));
            change(&mut section);
            section.check().map_err(|error| error.to_string())
        };
        assert_eq!(fixed(|_| ()), Ok(()));
        let changes: [fn(&mut TokenizerSection); 3] = [
            |s| s.encoder_blocks = Some(1),
            |s| s.commitment = Some(1.0),
            |s| s.reset_share = Some(0.1),
        ];
        for change in changes {
            assert!(fixed(change).unwrap_err().contains("belongs to `codes: learned`"));
        }
        assert!(fixed(|s| s.kind = TokenizerKind::Vq).unwrap_err().contains("`kind: patch`"));
    }
}
