//! MARDM's MotionCLIP, without its pretrained text: two transformers and symmetric InfoNCE.
//!
//! Shapes: m rows of all sequences, n sequences or pairs, c channels, d width, e numbers of an embedding.

use std::sync::Arc;

use burn::module::{Module, Param};
use burn::tensor::activation::log_softmax;
use burn::tensor::{Bool, Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;

use super::seen::{Networks, Pairs, Rows};
use crate::generator::stack::{Backbone, Block, EPSILON};
use crate::learn::params::{constant, normal};
use crate::ops::{HeadWeights, Kernels, Rope};
use crate::spec::{EvaluatorSpec, Ffn, ModelShape, MotionClipSpec};

/// 1 / 0.07, by which cosines are multiplied at first (Radford et al. 2021).
const FIRST_SCALE: f64 = 1.0 / 0.07;

/// All parameters of an evaluator of this kind.
#[derive(Module, Debug)]
pub struct Towers {
    motion: Tower,
    caption: Tower,
    /// The logarithm of the scale of cosines, `[1]`.
    log_scale: Param<Tensor<1>>,
}

impl Towers {
    /// Draws parameters, for motions of `n_features` features a frame.
    pub fn init(
        spec: &EvaluatorSpec,
        sizes: &MotionClipSpec,
        n_features: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let mut tower = |channels| Tower::init(spec, sizes, channels, rng, device);
        Self {
            motion: tower(sizes.frames * n_features),
            caption: tower(spec.word_dim),
            log_scale: constant([1], FIRST_SCALE.ln() as f32, device),
        }
    }
}

impl Networks for Towers {
    fn motions(&self, rows: &Rows) -> Tensor<2> {
        self.motion.embed(rows)
    }

    fn captions(&self, rows: &Rows) -> Tensor<2> {
        self.caption.embed(rows)
    }

    fn loss(&self, pairs: &Pairs, _rng: Option<&mut ChaCha8Rng>) -> Tensor<1> {
        let motions = self.motion.embed(&pairs.motions.and(&pairs.corrupted));
        let captions = self.caption.embed(&pairs.captions);
        contrast(motions, captions, self.log_scale.val(), &pairs.caption_ids)
    }
}

// [`Tower`]: sequences of vectors into one unit vector each.

/// The parameters of a tower: a summary row precedes each sequence, and every row attends to every other.
#[derive(Module, Debug)]
struct Tower {
    /// `[c, d]`.
    weight: Param<Tensor<2>>,
    bias: Param<Tensor<1>>,
    /// `[1, d]`.
    summary: Param<Tensor<2>>,
    blocks: Vec<Block>,
    norm: Param<Tensor<1>>,
    /// `[d, e]`.
    head: Param<Tensor<2>>,
    #[module(skip)]
    shape: ModelShape,
    #[module(skip)]
    rope: Arc<Rope>,
}

impl Tower {
    /// Initialises parameters like a generator's transformer.
    fn init(
        spec: &EvaluatorSpec,
        sizes: &MotionClipSpec,
        channels: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let (d, shape) = (sizes.width, shape(spec, sizes));
        let std = (2.0 / (5.0 * d as f64)).sqrt();
        Self {
            weight: normal([channels, d], (channels as f64).sqrt().recip(), rng, device),
            bias: constant([d], 0.0, device),
            summary: normal([1, d], 1.0, rng, device),
            blocks: (0..sizes.layers).map(|_| Block::init(&shape, std, rng, device)).collect(),
            norm: constant([d], 1.0, device),
            head: normal([d, spec.dim], (d as f64).sqrt().recip(), rng, device),
            rope: Arc::new(Rope::new(shape.n_ctx, d / sizes.heads, shape.rope_base)),
            shape,
        }
    }

    /// A unit vector of each sequence, `[n, e]`.
    fn embed(&self, rows: &Rows) -> Tensor<2> {
        let (device, shape, rope) = (self.weight.device(), self.shape.clone(), self.rope.clone());
        let kernels = Kernels::for_device(&device);
        let backbone = Backbone { shape, rope, kernels, device };
        let vectors_md = backbone.projected(rows.values.clone(), &self.weight, &self.bias);
        let summary = vectors_md.dims()[0] as u32;
        let all = Tensor::cat(vec![vectors_md, self.summary.val()], 0);
        let x_md = kernels.select_rows(all, &rows.order(summary));
        let x_md = backbone.forward(&self.blocks, x_md, &rows.summarised());
        let x_nd = kernels.select_rows(x_md, &rows.summaries());
        let head = HeadWeights { gamma_d: self.norm.val(), weight_dv: self.head.val() };
        unit(kernels.logits(x_nd, head, EPSILON))
    }
}

/// x / |x|, row by row.
fn unit(x_ne: Tensor<2>) -> Tensor<2> {
    let square_n1 = x_ne.clone().powi_scalar(2).sum_dim(1);
    x_ne.div(square_n1.add_scalar(1e-12).sqrt())
}

/// The sizes of the blocks of both towers; fields for models of codes are zero.
fn shape(spec: &EvaluatorSpec, sizes: &MotionClipSpec) -> ModelShape {
    let longest = spec.max_words.max(spec.window / sizes.frames);
    ModelShape {
        n_layer: sizes.layers,
        n_head: sizes.heads,
        d_model: sizes.width,
        d_ff: 8 * sizes.width / 3,
        n_ctx: longest + 1,
        d_text: 0,
        ffn: Ffn::SwiGlu,
        tie_embeddings: false,
        rope_base: 10_000.0,
    }
}

// The loss by which pairs find one another.

/// Cosines are multiplied by 100 at most (Radford et al. 2021).
const MOST_SCALE: f64 = 100.0;

/// The stand-in for −∞ for excluded pairs.
const LEFT_OUT: f64 = -1e9;

/// Symmetric InfoNCE of unit vectors of `n` captions and of `n` motions or more, `[·, e]` each, in nats, `[1]`: the mean
/// cross-entropy of finding a motion's caption in the batch, and a caption's motion.
///
/// Motions behind the first n, which have no caption, are wrong answers. Other pairs with the same caption are no
/// negatives: they are left out.
fn contrast(
    motions_me: Tensor<2>,
    captions_ne: Tensor<2>,
    log_scale: Tensor<1>,
    caption_ids: &[u32],
) -> Tensor<1> {
    let (n, device) = (caption_ids.len(), motions_me.device());
    let scale = log_scale.clamp_max(MOST_SCALE.ln()).exp().unsqueeze::<2>();
    let logits_nm = captions_ne.matmul(motions_me.transpose()).mul(scale);
    let logits_nn = logits_nm.clone().slice([0..n, 0..n]);
    let logits_nn = logits_nn.mask_fill(same(caption_ids, &device), LEFT_OUT);
    let own_nn = Tensor::<2>::eye(n, &device);
    let cross_entropy = |logits: Tensor<2>| {
        (log_softmax(logits, 1).slice([0..n, 0..n]) * own_nn.clone()).sum().neg() / n as f64
    };
    let of_captions = match logits_nm.dims()[1] {
        all if all > n => Tensor::cat(vec![logits_nn.clone(), logits_nm.slice([0..n, n..all])], 1),
        _ => logits_nn.clone(),
    };
    (cross_entropy(of_captions) + cross_entropy(logits_nn.transpose())) * 0.5
}

/// Different pairs with the same caption.
fn same(caption_ids: &[u32], device: &Device) -> Tensor<2, Bool> {
    let n = caption_ids.len();
    let of = |i: usize| (0..n).map(move |j| i != j && caption_ids[i] == caption_ids[j]);
    let values: Vec<bool> = (0..n).flat_map(of).collect();
    Tensor::from_data(TensorData::new(values, [n, n]), device)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn loss(motions: [[f32; 2]; 3], captions: [[f32; 2]; 3], ids: [u32; 3]) -> f64 {
        let device = Device::flex();
        let [motions, captions] = [motions, captions].map(|v| Tensor::from_data(v, &device));
        let log_scale = Tensor::from_data([2f32.ln()], &device);
        f64::from(contrast(motions, captions, log_scale, &ids).into_scalar::<f32>())
    }

    #[test]
    fn a_motion_without_a_caption_is_a_wrong_answer_to_every_caption() {
        let device = Device::flex();
        let of = |motions: Vec<[f32; 2]>| {
            let motions =
                Tensor::from_data(TensorData::new(motions.concat(), [motions.len(), 2]), &device);
            let captions = Tensor::from_data([[1.0, 0.0], [0.0, 1.0]], &device);
            let log_scale = Tensor::from_data([0f32], &device);
            f64::from(contrast(motions, captions, log_scale, &[0, 1]).into_scalar::<f32>())
        };
        let e = 1f64.exp();
        let [alone, beside] = [e + 1.0, e + 1.0 + (-1f64).exp()].map(|sum| sum.ln() - 1.0);
        let [right, up, down] = [[1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
        assert!((of(vec![right, up]) - alone).abs() < 1e-6);
        // The first caption is at a right angle to the third motion, the second opposite.
        let first = (e + 2.0).ln() - 1.0;
        let expected = (alone + 0.5 * (first + beside)) / 2.0;
        assert!((of(vec![right, up, down]) - expected).abs() < 1e-6);
    }

    /// By hand: cosines 1, 0 and −1, times 2.
    #[test]
    fn it_is_the_mean_cross_entropy_of_both_directions() {
        let [right, up, left] = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]];
        let found = loss([right, up, left], [right, up, left], [0, 1, 2]);
        let e = |x: f64| x.exp();
        let at_the_ends = (e(2.0) + e(0.0) + e(-2.0)).ln() - 2.0;
        let between = (e(2.0) + 2.0 * e(0.0)).ln() - 2.0;
        assert!((found - (2.0 * at_the_ends + between) / 3.0).abs() < 1e-6, "{found}");
        assert!((loss([up; 3], [up; 3], [0, 1, 2]) - 3f64.ln()).abs() < 1e-6);
    }

    #[test]
    fn pairs_of_the_same_caption_are_no_wrong_answers() {
        let up = [0.0, 1.0];
        assert!(loss([up; 3], [up; 3], [7, 7, 7]).abs() < 1e-6);
        let two = (2.0 * 2f64.ln() + 3f64.ln()) / 3.0;
        assert!((loss([up; 3], [up; 3], [7, 7, 1]) - two).abs() < 1e-6);
    }
}
