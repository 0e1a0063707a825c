//! What lies around the quantizer of a tokenizer: features to latents and back. A folder a kind.
//!
//! The macros below are the one place that tells kinds apart.
//!
//! Shapes: b clips, t frames, f features, c latent channels; t/s latents where a latent stands for s
//! frames.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::convolutional::{Decoder, Encoder};
use super::pass::Pass;
use super::patch::{PatchDecoder, PatchEncoder};
use super::transformer::{TransformerDecoder, TransformerEncoder};
use crate::spec::ArchitectureSpec;

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

/// Has an enum stand for whichever part it holds, by the trait that all of them have.
macro_rules! stands_for {
    ($any:ident, $part:ident: $($kind:ident),*) => {
        impl std::ops::Deref for $any {
            type Target = dyn $part;

            fn deref(&self) -> &Self::Target {
                match self {
                    $(Self::$kind(part) => part,)*
                }
            }
        }

        impl std::ops::DerefMut for $any {
            fn deref_mut(&mut self) -> &mut Self::Target {
                match self {
                    $(Self::$kind(part) => part,)*
                }
            }
        }
    };
}
pub(super) use stands_for;

/// Has a half begin with fresh weights.
macro_rules! begins {
    ($any:ident, $part:ident: $($kind:ident $half:ident),*) => {
        impl $any {
            /// Fresh weights of an architecture, for frames of `n_features`.
            pub fn new(
                spec: &ArchitectureSpec,
                n_features: usize,
                rng: &mut ChaCha8Rng,
                device: &Device,
            ) -> Self {
                match spec {
                    $(ArchitectureSpec::$kind(sizes) => {
                        Self::$kind($half::new(sizes, n_features, rng, device))
                    })*
                }
            }
        }

        stands_for!($any, $part: $($kind),*);
    };
}

begins!(AnyEncoder, Encode: Convolutional Encoder, Patch PatchEncoder, Transformer TransformerEncoder);
begins!(AnyDecoder, Decode: Convolutional Decoder, Patch PatchDecoder, Transformer TransformerDecoder);
