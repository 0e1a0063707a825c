//! What lies between the halves of a tokenizer: latents to codes and back. A file a kind.
//!
//! [`init`] is the one place that tells kinds apart.
//!
//! Shapes: b clips, t latents of a clip, c channels.

mod fsq;
mod k_means;
mod nearest;
mod vq;

use std::ops::{Deref, DerefMut};

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

pub use fsq::Fsq;
pub use vq::Vq;

use crate::learn::{LearnerState, LoadedState};
use crate::spec::{QuantizerSpec, TokenizerSpec};

/// A map from the latents of clips to the codes of a [`Grid`](crate::codes::Grid).
///
/// Codes stand clip after clip, those of a clip scale after scale.
pub trait Quantizer {
    /// Begins from latents of the training split, `[n, c]`.
    fn begin(&mut self, _latents_nc: &Tensor<2>) {}

    /// One training step: what the decoder sees, and what the quantizer learns on the host.
    fn quantize(&mut self, latents_btc: Tensor<3>) -> Quantized;

    /// The codes of clips.
    fn ids(&self, latents_btc: Tensor<3>) -> Vec<u32>;

    /// What the decoder sees for the codes of `n_clips` clips of one length, `[b, t, c]`; every id
    /// is below its scale's `n_vocab`.
    fn embed(&self, ids: &[u32], n_clips: usize) -> Tensor<3>;

    /// What training needs to go on from beside the weights.
    fn keep(&self) -> LearnerState {
        LearnerState::default()
    }

    /// Takes up what [`Quantizer::keep`] gave; `None` where it is not that.
    fn resume(&mut self, _: LoadedState) -> Option<()> {
        Some(())
    }
}

/// Latents after quantization, in training.
pub struct Quantized {
    /// The codes' embeddings, `[b, t, c]`, with the gradient passed straight through to the latents.
    pub quantized_btc: Tensor<3>,
    /// A term for the training loss, already weighted, `[1]`.
    pub auxiliary_loss: Option<Tensor<1>>,
}

/// A quantizer of any kind, as part of a module.
#[derive(Module, Debug)]
pub enum AnyQuantizer {
    Fsq(Fsq),
    Vq(Vq),
}

/// The quantizer of a tokenizer, for latents with `code_dim` channels.
pub fn init(
    spec: &TokenizerSpec,
    code_dim: usize,
    rng: &mut ChaCha8Rng,
    device: &Device,
) -> AnyQuantizer {
    match &spec.quantizer {
        QuantizerSpec::Fsq { levels } => AnyQuantizer::Fsq(Fsq::new(levels, code_dim, rng, device)),
        QuantizerSpec::Vq { n_vocab } => {
            AnyQuantizer::Vq(Vq::new(*n_vocab, code_dim, &spec.training, rng, device))
        }
    }
}

impl Deref for AnyQuantizer {
    type Target = dyn Quantizer;

    fn deref(&self) -> &Self::Target {
        match self {
            AnyQuantizer::Fsq(fsq) => fsq,
            AnyQuantizer::Vq(vq) => vq,
        }
    }
}

impl DerefMut for AnyQuantizer {
    fn deref_mut(&mut self) -> &mut Self::Target {
        match self {
            AnyQuantizer::Fsq(fsq) => fsq,
            AnyQuantizer::Vq(vq) => vq,
        }
    }
}

/// Latents of all clips as rows, `[b·t, c]`.
fn rows(latents_btc: Tensor<3>) -> Tensor<2> {
    let [b, t, c] = latents_btc.dims();
    latents_btc.reshape([b * t, c])
}

/// Rows as the latents of `n_clips` clips.
fn clips(latents_nc: Tensor<2>, n_clips: usize) -> Tensor<3> {
    let [n, c] = latents_nc.dims();
    latents_nc.reshape([n_clips, n / n_clips, c])
}
