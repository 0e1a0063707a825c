//! What lies around the quantizer of a tokenizer: features to latents and back. A folder a kind.
//!
//! [`of`] is the one place that tells kinds apart.
//!
//! Shapes: b clips, t frames, f features, c latent channels; t/s latents where a latent stands for s
//! frames.

use std::ops::{Deref, DerefMut};

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::convolutional::{AutoencoderConfig, Decoder, Encoder};
use super::pass::Pass;
use super::patch::{PatchConfig, PatchDecoder, PatchEncoder};
use super::transformer::{TransformerConfig, TransformerDecoder, TransformerEncoder};
use crate::spec::ArchitectureSpec;

/// A kind of architecture with its sizes.
pub trait Architecture {
    /// Channels of a latent.
    fn code_dim(&self) -> usize;

    /// The half that turns features into latents.
    fn encoder(&self, rng: &mut ChaCha8Rng, device: &Device) -> AnyEncoder;

    /// The half that turns latents into features.
    fn decoder(&self, rng: &mut ChaCha8Rng, device: &Device) -> AnyDecoder;
}

/// The architecture of a spec for frames of `n_features`.
pub fn of(spec: &ArchitectureSpec, n_features: usize) -> Box<dyn Architecture> {
    match spec {
        ArchitectureSpec::Convolutional(sizes) => {
            Box::new(AutoencoderConfig::of(sizes, n_features))
        }
        ArchitectureSpec::Patch(sizes) => {
            Box::new(PatchConfig { sizes: sizes.clone(), n_features })
        }
        ArchitectureSpec::Transformer(sizes) => {
            Box::new(TransformerConfig { sizes: sizes.clone(), n_features })
        }
    }
}

/// Normalised features to latents.
pub trait Encode {
    /// `[b, t, f]` to `[b, t/s, c]`; t is a multiple of s.
    fn forward(&self, x_btf: Tensor<3>, pass: &mut Pass) -> Tensor<3>;

    /// Begins from patches, `[n, s·f]`.
    fn begin(&mut self, _patches_np: &Tensor<2>) {}
}

/// Latents to normalised features.
pub trait Decode {
    /// `[b, t/s, c]` to `[b, t, f]`.
    fn forward(&self, latents_btc: Tensor<3>, pass: &mut Pass) -> Tensor<3>;

    /// Begins from the latents of patches, `[n, c]`.
    fn begin(&mut self, _latents_nc: &Tensor<2>, _patches_np: &Tensor<2>) {}
}

/// An encoder of any kind, as part of a module.
#[derive(Module, Debug)]
#[expect(clippy::large_enum_variant, reason = "a tokenizer holds one, and never many in a row")]
pub enum AnyEncoder {
    Convolutional(Encoder),
    Patch(PatchEncoder),
    Transformer(TransformerEncoder),
}

/// A decoder of any kind, as part of a module.
#[derive(Module, Debug)]
#[expect(clippy::large_enum_variant, reason = "a tokenizer holds one, and never many in a row")]
pub enum AnyDecoder {
    Convolutional(Decoder),
    Patch(PatchDecoder),
    Transformer(TransformerDecoder),
}

impl Deref for AnyEncoder {
    type Target = dyn Encode;

    fn deref(&self) -> &Self::Target {
        match self {
            Self::Convolutional(encoder) => encoder,
            Self::Patch(encoder) => encoder,
            Self::Transformer(encoder) => encoder,
        }
    }
}

impl Deref for AnyDecoder {
    type Target = dyn Decode;

    fn deref(&self) -> &Self::Target {
        match self {
            Self::Convolutional(decoder) => decoder,
            Self::Patch(decoder) => decoder,
            Self::Transformer(decoder) => decoder,
        }
    }
}

impl DerefMut for AnyEncoder {
    fn deref_mut(&mut self) -> &mut Self::Target {
        match self {
            Self::Convolutional(encoder) => encoder,
            Self::Patch(encoder) => encoder,
            Self::Transformer(encoder) => encoder,
        }
    }
}

impl DerefMut for AnyDecoder {
    fn deref_mut(&mut self) -> &mut Self::Target {
        match self {
            Self::Convolutional(decoder) => decoder,
            Self::Patch(decoder) => decoder,
            Self::Transformer(decoder) => decoder,
        }
    }
}
