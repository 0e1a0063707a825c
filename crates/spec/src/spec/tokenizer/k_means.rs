//! The k-means that a tokenizer is measured beside, as a tokenizer of its own.

use super::TokenizerSpec;
use crate::spec::{
    ArchitectureSpec, CodebookSpec, PatchSpec, QuantizerSpec, ResidualSpec, TokenizerTraining,
};

/// Clips that its centres are placed by, and their mirror images.
const CLIPS: usize = 512;

impl TokenizerSpec {
    /// k-means of patches as long as what a code stands for, four frames at most, since principal
    /// components of longer ones take minutes and gigabytes; with as many codebooks of as many codes as
    /// this tokenizer has. None for scales of several lengths, which it cannot place.
    pub fn k_means_beside(&self) -> Option<Self> {
        let n_vocab = self.quantizer.codebooks().first()?.n_vocab();
        let codebook = CodebookSpec::Vq { n_vocab };
        let quantizer = match &self.quantizer {
            QuantizerSpec::Fsq { .. } | QuantizerSpec::Vq { .. } => {
                QuantizerSpec::of_codebook(codebook)
            }
            QuantizerSpec::Residual(own) => {
                QuantizerSpec::Residual(ResidualSpec { codebook, ..own.clone() })
            }
            QuantizerSpec::Multiscale(_) => return None,
        };
        let longest = PatchSpec::default();
        let frames = self.frames_per_latent().min(longest.frames);
        Some(Self {
            architecture: ArchitectureSpec::Patch(PatchSpec { frames, ..longest }),
            quantizer,
            training: TokenizerTraining { pool_clips: CLIPS, ..TokenizerTraining::of_patches() },
            ..Self::default()
        })
    }
}
