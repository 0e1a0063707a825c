//! Quantizers: latents to codes and back, between the halves of a tokenizer. One file per kind, plain and
//! residual.
//!
//! Shapes: b clips, t latents of a clip, s codes of a clip on a scale, c channels.

mod averages;
mod fsq;
mod multiscale;
#[cfg(test)]
mod tests;
mod vq;

use burn::tensor::{Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde_json::{Value, json};

use super::halves::host;
use crate::draws::{below, unit};
use crate::learn::layers::Affine;
use crate::learn::{LearnerState, LoadedState};

pub use fsq::{Fsq, ResidualFsq};
pub use multiscale::Multiscale;
pub use vq::{ResidualVq, Vq};

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

    /// The cumulative sums over scales, `[b, t, c]` each, one per scale with codes: a prefix of the scales is allowed. Every
    /// id is below its scale's `n_vocab`.
    fn sums(&self, ids: &[u32], extent: Extent) -> Vec<Tensor<3>>;

    /// The decoder's input for the codes of clips, `[b, t, c]`: the last of [`Quantizer::sums`].
    fn embed(&self, ids: &[u32], extent: Extent) -> Tensor<3> {
        self.sums(ids, extent).pop().expect("codes of one scale at least")
    }

    /// The embedding of every code of each scale by itself, `[v, c]` each.
    fn codebooks(&self) -> Vec<Tensor<2>>;

    /// The inputs of a scale-by-scale generator for each scale but the first: the sum of the earlier scales, at the scale's
    /// length, `[b, s, c]` (VAR, LG-Tok). Codes of the first n scales give the inputs of the existing scales among 2 to
    /// n + 1.
    fn inputs(&self, ids: &[u32], extent: Extent) -> Vec<Tensor<3>> {
        let lengths = self.lengths(extent.n_latents);
        let sums = self.sums(ids, extent).into_iter();
        sums.zip(lengths.into_iter().skip(1)).map(|(sum, s)| area_down(sum, s)).collect()
    }

    /// The key of each generator that codebooks draw from while they learn.
    fn keys(&self) -> Vec<[u8; 32]> {
        Vec::new()
    }

    /// The state of training, besides weights.
    fn keep(&self) -> LearnerState {
        LearnerState::default()
    }

    /// Takes up what [`Quantizer::keep`] gave; `None` if it is not that.
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

/// Clips of one length, whose latents are quantized together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    pub n_clips: usize,
    /// Latents of each clip.
    pub n_latents: usize,
}

// Codes in order: scale after scale within a clip, or clip after clip within a scale.

/// Codes clip after clip, those of a clip scale after scale, from those of each scale, clip after clip.
fn by_clip<'a>(scales: &'a [Vec<u32>], n_clips: usize) -> Vec<u32> {
    let parts = (0..n_clips).flat_map(|clip| scales.iter().map(move |own| (clip, own)));
    let part = |(clip, own): (usize, &'a Vec<u32>)| {
        let length = own.len() / n_clips;
        &own[clip * length..][..length]
    };
    parts.flat_map(part).copied().collect()
}

/// The inverse of [`by_clip`] for clips that have `lengths` codes on their scales, or the codes of
/// their first scales alone: as many scales come back as there are codes of.
///
/// # Panics
/// If the codes are those of no whole number of scales.
pub fn by_scale(ids: &[u32], lengths: &[usize], n_clips: usize) -> Vec<Vec<u32>> {
    let per_clip = ids.len() / n_clips;
    let (mut scales, mut from) = (Vec::new(), 0);
    for length in lengths {
        if from + length > per_clip {
            break;
        }
        let own = ids.chunks_exact(per_clip).flat_map(|clip| &clip[from..from + length]);
        scales.push(own.copied().collect());
        from += length;
    }
    assert_eq!(from * n_clips, ids.len(), "codes of {n_clips} clips with {lengths:?} codes each");
    scales
}

// Latents of a clip at another length: linear maps along time, the same for every clip and channel.

/// `[b, t, c]` to `[b, s, c]`: latent i is the mean of ⌊iT/s⌋..⌈(i+1)T/s⌉ (adaptive average pooling, as
/// LG-Tok's code has it). Bins overlap where s does not divide t, and repeat where s is larger.
pub fn area_down(x_btc: Tensor<3>, s: usize) -> Tensor<3> {
    along_time(x_btc, s, area_weights)
}

/// `[b, s, c]` to `[b, t, c]`: latent i lies at (i + ½)·s/t − ½ on the line through the latents around
/// it, at least at 0 (linear interpolation with `align_corners=False`).
pub fn linear_up(x_bsc: Tensor<3>, t: usize) -> Tensor<3> {
    along_time(x_bsc, t, linear_weights)
}

/// The map with `weights`, `[to, from]`; where both are of one length, it changes nothing.
fn along_time(x_btc: Tensor<3>, to: usize, weights: fn(usize, usize) -> Vec<f32>) -> Tensor<3> {
    let [_, from, _] = x_btc.dims();
    if from == to {
        return x_btc;
    }
    let data = TensorData::new(weights(to, from), [1, to, from]);
    Tensor::<3>::from_data(data, &x_btc.device()).matmul(x_btc)
}

fn area_weights(to: usize, from: usize) -> Vec<f32> {
    let mut weights = vec![0.0; to * from];
    for (i, row) in weights.chunks_exact_mut(from).enumerate() {
        let bin = i * from / to..((i + 1) * from).div_ceil(to);
        let share = 1.0 / bin.len() as f32;
        row[bin].fill(share);
    }
    weights
}

fn linear_weights(to: usize, from: usize) -> Vec<f32> {
    let mut weights = vec![0.0; to * from];
    for (i, row) in weights.chunks_exact_mut(from).enumerate() {
        let place = ((i as f64 + 0.5) * from as f64 / to as f64 - 0.5).max(0.0);
        let left = place as usize;
        let right = (left + 1).min(from - 1);
        let share = (place - left as f64) as f32;
        row[left] += 1.0 - share;
        row[right] += share;
    }
    weights
}

// What several codebooks keep, as the state of one quantizer: each under its number.

const PARTS: &str = "parts";
const OWN: &str = "own";

/// The states of `parts` as one, with `note` beside theirs.
fn keep_parts<'a>(
    parts: impl Iterator<Item = &'a (dyn Quantizer + 'static)>,
    note: Value,
) -> LearnerState {
    let (mut all, mut notes) = (LearnerState::default(), Vec::new());
    for (i, part) in parts.enumerate() {
        let LearnerState { note, tensors } = part.keep();
        notes.push(note);
        all.tensors.extend(tensors.into_iter().map(|(name, x)| (format!("{i}.{name}"), x)));
    }
    all.note = json!({ PARTS: notes, OWN: note });
    all
}

/// Gives each part its own of what [`keep_parts`] gave, and returns the note; `None` if it is not that.
fn resume_parts<'a>(
    parts: impl Iterator<Item = &'a mut (dyn Quantizer + 'static)>,
    mut saved: LoadedState,
) -> Option<Value> {
    for (i, part) in parts.enumerate() {
        let prefix = format!("{i}.");
        let own = saved.tensors.iter().filter_map(|(name, tensor)| {
            Some((name.strip_prefix(&prefix)?.to_string(), tensor.clone()))
        });
        let tensors = own.collect();
        let note = saved.note[PARTS].get_mut(i)?.take();
        part.resume(LoadedState { note, tensors })?;
    }
    Some(saved.note[OWN].take())
}

// What residual kinds, and the formulas of several kinds, have in common.

/// Draws how many layers a training step uses, so that the first of them carry what they can alone.
#[derive(Clone, Debug)]
struct Dropout {
    /// Probability of dropping layers.
    share: f64,
    rng: ChaCha8Rng,
}

impl Dropout {
    /// One with its own stream of numbers.
    fn new(share: f64, rng: &mut ChaCha8Rng) -> Self {
        Self { share, rng: ChaCha8Rng::seed_from_u64(rng.next_u64()) }
    }

    /// All `n` layers, or with the share's probability a number from 1 to `n`, each as likely.
    fn layers(&mut self, n: usize) -> usize {
        if unit(&mut self.rng) < self.share { 1 + below(&mut self.rng, n) } else { n }
    }

    /// Position of its random generator, as text, since it has 68 bits.
    fn keep(&self) -> Value {
        json!(self.rng.get_word_pos().to_string())
    }

    /// Takes up what [`Dropout::keep`] gave; `None` if it is not that.
    fn resume(&mut self, saved: &Value) -> Option<()> {
        self.rng.set_word_pos(saved.as_str()?.parse().ok()?);
        Some(())
    }
}

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
    let (mut inward, mut outward) = (vec![0.0; c * d], vec![0.0; d * c]);
    for (i, deviation) in host(squares.sqrt()).into_iter().take(d).enumerate() {
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
