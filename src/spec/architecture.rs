//! [`ArchitectureSpec`]: which network turns features into latents and back.

use serde::{Deserialize, Serialize};

use super::error::{SpecError, require};

/// An architecture of a tokenizer, resolved: what is hashed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum ArchitectureSpec {
    /// T2M-GPT's convolutional autoencoder, which ScaMo keeps.
    Convolutional(ConvolutionalSpec),
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
        }
    }

    /// Frames that one latent stands for.
    pub fn frames_per_latent(&self) -> usize {
        match self {
            Self::Convolutional(ConvolutionalSpec { down, .. }) => 1 << down,
        }
    }

    /// FLOPs that training on a frame counts for, beside the budgets of runs.
    pub fn flops_per_frame(&self) -> f64 {
        match self {
            Self::Convolutional(ConvolutionalSpec { width, .. }) => {
                FLOPS_PER_FRAME_AND_WIDTH_SQUARED * (*width as f64).powi(2)
            }
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
        }
    }

    /// Bytes that encoding a frame takes.
    pub fn encoding_bytes_per_frame(&self) -> f64 {
        match self {
            Self::Convolutional(ConvolutionalSpec { width, .. }) => 180.0 * *width as f64,
        }
    }

    /// The first field that no training can use.
    pub(super) fn check(&self) -> Result<(), SpecError> {
        match self {
            Self::Convolutional(ConvolutionalSpec { width, depth, down }) => {
                require(*width > 0, "width", "at least one channel")?;
                require(*depth > 0, "depth", "at least one block")?;
                require((1..=6).contains(down), "down", "must be 1 to 6")
            }
        }
    }
}
