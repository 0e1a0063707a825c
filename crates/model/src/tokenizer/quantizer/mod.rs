//! What lies between the halves of a tokenizer: latents to codes and back. A file a kind.
//!
//! [`init`] is the one place that tells kinds apart.
//!
//! Shapes: b clips, t latents of a clip, s codes of a clip on a scale, c channels.

mod averages;
mod codebook;
mod dropout;
mod fsq;
mod k_means;
mod multiscale;
mod nearest;
mod order;
mod resample;
mod residual_fsq;
mod residual_vq;
mod smoothing;
mod states;
mod vq;

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

pub use fsq::Fsq;
pub use multiscale::Multiscale;
pub use order::{Extent, by_scale};
pub use resample::{area_down, linear_up};
pub use residual_fsq::ResidualFsq;
pub use residual_vq::ResidualVq;
pub use vq::Vq;

use crate::learn::layers::Affine;
use crate::learn::{LearnerState, LoadedState};
use crate::spec::{CodebookSpec, QuantizerSpec, TokenizerSpec};
use crate::tokenizer::architecture::stands_for;

/// A map from the latents of clips to the codes of a [`Grid`](crate::codes::Grid).
///
/// Codes stand clip after clip, those of a clip scale after scale; an id counts from 0 on each scale.
/// Codes of a fixed number do not tell a clip's latents, so decoding is told them.
pub trait Quantizer {
    /// Begins from latents of the training split, `[n, c]`.
    fn begin(&mut self, _latents_nc: &Tensor<2>) {}

    /// One training step: what the decoder sees, and what the quantizer learns on the host.
    fn quantize(&mut self, latents_btc: Tensor<3>) -> Quantized;

    /// The codes of clips.
    fn ids(&self, latents_btc: Tensor<3>) -> Vec<u32>;

    /// The codes of each scale of a clip of so many latents.
    fn lengths(&self, n_latents: usize) -> Vec<usize> {
        vec![n_latents]
    }

    /// What the first scale adds, the first two together, and so on, `[b, t, c]` each, for as many
    /// scales as there are codes of: the codes of each clip may end after any scale. Every id is below
    /// its scale's `n_vocab`.
    fn sums(&self, ids: &[u32], extent: Extent) -> Vec<Tensor<3>>;

    /// What the decoder sees for the codes of clips, `[b, t, c]`: the last of [`Quantizer::sums`].
    fn embed(&self, ids: &[u32], extent: Extent) -> Tensor<3> {
        self.sums(ids, extent).pop().expect("codes of one scale at least")
    }

    /// The embedding of every code of each scale by itself, `[v, c]` each.
    fn codebooks(&self) -> Vec<Tensor<2>>;

    /// What a generator that makes codes scale after scale is shown before each scale but the first:
    /// the sum of the scales before it, at its own length, `[b, s, c]` (VAR, LG-Tok). Codes of the first
    /// n scales give the inputs of the scales 2 to n + 1, as far as there are such.
    fn inputs(&self, ids: &[u32], extent: Extent) -> Vec<Tensor<3>> {
        let lengths = self.lengths(extent.n_latents);
        let sums = self.sums(ids, extent).into_iter();
        sums.zip(lengths.into_iter().skip(1)).map(|(sum, s)| area_down(sum, s)).collect()
    }

    /// The key of each generator that codebooks draw from while they learn.
    fn keys(&self) -> Vec<[u8; 32]> {
        Vec::new()
    }

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
    ResidualFsq(ResidualFsq),
    ResidualVq(ResidualVq),
    Multiscale(Multiscale),
}

/// The quantizer of a tokenizer, for latents with `code_dim` channels.
pub fn init(
    spec: &TokenizerSpec,
    code_dim: usize,
    rng: &mut ChaCha8Rng,
    device: &Device,
) -> AnyQuantizer {
    let training = &spec.training;
    match &spec.quantizer {
        QuantizerSpec::Fsq { levels } => AnyQuantizer::Fsq(Fsq::new(levels, code_dim, rng, device)),
        QuantizerSpec::Vq { n_vocab } => {
            AnyQuantizer::Vq(Vq::new(*n_vocab, code_dim, training, rng, device))
        }
        QuantizerSpec::Residual(own) => match &own.codebook {
            CodebookSpec::Fsq { levels } => {
                AnyQuantizer::ResidualFsq(ResidualFsq::new(own, levels, code_dim, rng, device))
            }
            CodebookSpec::Vq { n_vocab } => {
                let layers = ResidualVq::new(own, *n_vocab, code_dim, training, rng, device);
                AnyQuantizer::ResidualVq(layers)
            }
        },
        QuantizerSpec::Multiscale(own) => {
            AnyQuantizer::Multiscale(Multiscale::new(own, code_dim, training, rng, device))
        }
    }
}

stands_for!(AnyQuantizer, Quantizer: Fsq, Vq, ResidualFsq, ResidualVq, Multiscale);

/// The sums of the first, the first two, and so on. The first is added to zeros, so that a code of −0
/// has the bits that it has in training.
fn running_sums<const D: usize>(
    parts: impl Iterator<Item = Tensor<D>>,
) -> impl Iterator<Item = Tensor<D>> {
    parts.scan(None, |sum: &mut Option<Tensor<D>>, part| {
        let before = sum.take().unwrap_or_else(|| part.zeros_like());
        Some(sum.insert(before + part).clone())
    })
}

/// Begins the projections of scalar quantization: each dimension as a channel of its own, the first
/// channels first, times `factors` of its deviation on the way in and on the way out.
fn begin_projections(
    [project_in, project_out]: [&mut Affine; 2],
    latents_nc: &Tensor<2>,
    factors: impl Fn(f32) -> [f32; 2],
) {
    let [n, c] = latents_nc.dims();
    let d = project_in.channels_out();
    let squares = (latents_nc.clone() * latents_nc.clone()).sum_dim(0) / n as f64;
    let deviations: Vec<f32> = squares.sqrt().into_data().try_into_vec().expect("f32");
    let (mut inward, mut outward) = (vec![0.0; c * d], vec![0.0; d * c]);
    for (i, deviation) in deviations.into_iter().take(d).enumerate() {
        [inward[i * d + i], outward[i * c + i]] = factors(deviation);
    }
    project_in.set(inward, vec![0.0; d]);
    project_out.set(outward, vec![0.0; c]);
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

/// A value with the gradient of another, which it passes straight through: the bracket is exactly 0.
fn straight_through<const D: usize>(value: Tensor<D>, gradient: Tensor<D>) -> Tensor<D> {
    value + (gradient.clone() - gradient.detach())
}

/// The mean of squared differences, `[1]`.
fn mean_square<const D: usize>(a: Tensor<D>, b: Tensor<D>) -> Tensor<1> {
    let apart = a - b;
    (apart.clone() * apart).mean()
}

#[cfg(test)]
mod tests;
