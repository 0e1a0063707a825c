//! The blocks that generators are made of, over whole sequences, packed row after row, and over such that grow.

use std::sync::Arc;

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;

use crate::learn::params::{constant, normal};
use crate::ops::{
    Activation, AttentionOptions, AttentionWeights, FeedForwardWeights, HalfFloat, HeadWeights,
    Joining, Kernels, KeyValues, Rope, RowLosses, SequenceLayout,
};
use crate::spec::{Ffn, ModelShape, Precision};

// [`Block`]: the parameters of a layer.

/// The parameters of a pre-norm transformer block.
///
/// x ← x + Attention(RMSNorm(x)) W_o, x ← x + FFN(RMSNorm(x)); no biases (ScaMo §3.1, LLaMA).
#[derive(Module, Debug)]
pub struct Block {
    norm_attention: Param<Tensor<1>>,
    /// `[d, 3d]`: queries, keys, values.
    qkv: Param<Tensor<2>>,
    /// `[d, d]`.
    output: Param<Tensor<2>>,
    norm_ffn: Param<Tensor<1>>,
    /// `[d, 2f]` (gate and up) with SwiGLU, `[d, f]` with GELU.
    up: Param<Tensor<2>>,
    /// `[f, d]`.
    down: Param<Tensor<2>>,
}

impl Block {
    /// Draws parameters: deviation `std`, projections back into the residual stream smaller by √(2L),
    /// gains 1.
    pub fn init(shape: &ModelShape, std: f64, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        let (d, f) = (shape.d_model, shape.d_ff);
        let residual_std = std / (2.0 * shape.n_layer as f64).sqrt();
        let up = match shape.ffn {
            Ffn::SwiGlu => 2 * f,
            Ffn::Gelu => f,
        };
        Self {
            norm_attention: constant([d], 1.0, device),
            qkv: normal([d, 3 * d], std, rng, device),
            output: normal([d, d], residual_std, rng, device),
            norm_ffn: constant([d], 1.0, device),
            up: normal([d, up], std, rng, device),
            down: normal([f, d], residual_std * (d as f64 / f as f64).sqrt(), rng, device),
        }
    }

    /// The parameters of its attention.
    pub fn attention(&self) -> AttentionWeights {
        AttentionWeights {
            gamma_d: self.norm_attention.val(),
            qkv_d3d: self.qkv.val(),
            output_dd: self.output.val(),
        }
    }

    /// The parameters of its feed-forward half.
    pub fn feed_forward(&self) -> FeedForwardWeights {
        FeedForwardWeights {
            gamma_d: self.norm_ffn.val(),
            up_du: self.up.val(),
            down_fd: self.down.val(),
        }
    }
}

// [`Backbone`]: the blocks of a model over whole sequences.
//
// Shapes: n rows of the batch, d width.

/// RMSNorm's ε, as in LLaMA.
pub const EPSILON: f32 = 1e-5;

/// The non-trained inputs of a model's forward pass.
#[derive(Clone, Debug)]
pub struct Backbone {
    pub shape: ModelShape,
    pub rope: Arc<Rope>,
    pub kernels: Kernels,
    pub device: Device,
}

impl Backbone {
    /// That of a model whose positions follow one another.
    pub fn new(shape: &ModelShape, kernels: Kernels, device: &Device) -> Self {
        let rope = Rope::new(shape.n_ctx, shape.d_model / shape.n_head, shape.rope_base);
        Self { shape: shape.clone(), rope: Arc::new(rope), kernels, device: device.clone() }
    }

    /// The same without gradients and in single precision, for evaluation.
    pub fn frozen(&self) -> Self {
        let kernels = match self.kernels {
            Kernels::Half(_) => Kernels::for_device(&self.device),
            single => single,
        };
        Self { kernels, device: self.device.clone().inner(), ..self.clone() }
    }

    /// The output of blocks for rows of packed sequences, `[n, d]`.
    pub fn forward(
        &self,
        blocks: &[Block],
        x_nd: Tensor<2>,
        layout: &Arc<SequenceLayout>,
    ) -> Tensor<2> {
        let (layout, rope) = (layout.clone(), self.rope.clone());
        let options = AttentionOptions::new(self.shape.n_head, layout, rope, EPSILON);
        blocks.iter().fold(x_nd, |x_nd, block| {
            let x_nd = self.kernels.attention(x_nd, block.attention(), &options);
            self.feed_forward(block, x_nd)
        })
    }

    /// The feed-forward half of a block, `[n, d]`.
    pub fn feed_forward(&self, block: &Block, x_nd: Tensor<2>) -> Tensor<2> {
        let activation = match self.shape.ffn {
            Ffn::SwiGlu => Activation::SwiGlu,
            Ffn::Gelu => Activation::Gelu,
        };
        self.kernels.feed_forward(x_nd, block.feed_forward(), activation, EPSILON)
    }

    /// x W + b of row-major vectors, each as long as the weight has rows, `[n, d]`.
    pub fn projected(
        &self,
        values: Vec<f32>,
        weight: &Param<Tensor<2>>,
        bias: &Param<Tensor<1>>,
    ) -> Tensor<2> {
        let [channels, _] = weight.dims();
        let rows = values.len() / channels;
        let x = Tensor::<2>::from_data(TensorData::new(values, [rows, channels]), &self.device);
        x.matmul(weight.val()) + bias.val().unsqueeze::<2>()
    }

    /// Rows of a parameter, in the order given, `[n, d]`.
    pub fn looked_up(&self, table: &Param<Tensor<2>>, rows: &Arc<[u32]>) -> Tensor<2> {
        self.kernels.select_rows(table.val(), rows)
    }
}

/// The kernels of a precision.
pub fn kernels_of(precision: Precision, device: &Device) -> Kernels {
    match precision {
        Precision::F32 => Kernels::for_device(device),
        Precision::F16 => Kernels::Half(HalfFloat::F16),
        Precision::Bf16 => Kernels::Half(HalfFloat::Bf16),
    }
}

// The losses of codes that have a head for each of their scales or layers.
//
// Shapes: n rows of the batch, d width.

/// Supervised codes of one scale or layer.
#[derive(Clone, Debug, Default)]
pub struct Supervised {
    /// Rows that predict them.
    pub rows: Arc<[u32]>,
    /// Their targets, below the codebook's V.
    pub codes: Arc<[u32]>,
}

impl From<(Vec<u32>, Vec<u32>)> for Supervised {
    fn from((rows, codes): (Vec<u32>, Vec<u32>)) -> Self {
        Self { rows: rows.into(), codes: codes.into() }
    }
}

/// Supervised codes in all.
pub fn n_supervised(targets: &[Supervised]) -> usize {
    targets.iter().map(|own| own.codes.len()).sum()
}

/// Mean cross-entropy over all supervised codes, in nats, `[1]`, from the output of the blocks for all rows, `[n, d]`;
/// each of the targets has its own head.
pub fn heads_loss(
    kernels: Kernels,
    x_nd: &Tensor<2>,
    targets: &[Supervised],
    head: impl Fn(usize) -> HeadWeights,
) -> Tensor<1> {
    let n = n_supervised(targets) as f64;
    let some = targets.iter().enumerate().filter(|(_, own)| !own.rows.is_empty());
    let losses = some.map(|(index, own)| {
        let x_sd = kernels.select_rows(x_nd.clone(), &own.rows);
        let mean = kernels.head_loss(x_sd, head(index), &own.codes, EPSILON);
        mean * (own.codes.len() as f64 / n)
    });
    losses.reduce(|sum, loss| sum + loss).expect("a batch supervises something")
}

/// −ln p of each supervised code and the likeliest code in its place, by the targets, as [`heads_loss`] has them.
pub fn heads_nll(
    kernels: Kernels,
    x_nd: &Tensor<2>,
    targets: &[Supervised],
    head: impl Fn(usize) -> HeadWeights,
) -> Vec<RowLosses> {
    let nll = targets.iter().enumerate().map(|(index, own)| {
        if own.rows.is_empty() {
            return RowLosses::default();
        }
        let x_sd = kernels.select_rows(x_nd.clone(), &own.rows);
        kernels.head_nll(x_sd, head(index), &own.codes, EPSILON)
    });
    nll.collect()
}

// [`Growing`]: sequences that grow; each pass computes only new positions.
//
// Text prefixes are padded at their ends; no position sees the padding. So the result equals a whole pass over
// `[text | motion]`.
//
// Shapes: b sequences, p positions of the longest text, m positions that join each, d width.

/// Sequences of text and later positions.
pub struct Growing<'a> {
    backbone: &'a Backbone,
    blocks: &'a [Block],
    /// Keys and values, one entry a block.
    kept: Vec<KeyValues>,
    /// Text positions of each sequence.
    prefixes: Vec<usize>,
    /// Positions of each after the longest text.
    joined: usize,
}

impl<'a> Growing<'a> {
    /// Sequences of so many text positions each, at least one, which [`Growing::join`] takes first.
    pub fn new(backbone: &'a Backbone, blocks: &'a [Block], prefixes: Vec<usize>) -> Self {
        let kept = vec![KeyValues::default(); blocks.len()];
        Self { backbone, blocks, kept, prefixes, joined: 0 }
    }

    /// p.
    pub fn longest_text(&self) -> usize {
        self.prefixes.iter().copied().max().unwrap_or(0)
    }

    /// Text positions of each sequence.
    pub fn prefixes(&self) -> &[usize] {
        &self.prefixes
    }

    /// The output of the blocks for the texts, padded to p positions each, `[b·p, d]`; with their angles as indices into
    /// the rope, `[b·p]`.
    pub fn text(&mut self, x_nd: Tensor<2>, angles: &[usize]) -> Tensor<2> {
        self.pass(x_nd, self.joining(angles))
    }

    /// The output of the blocks for m new positions of each sequence, `[b·m, d]`, given their angles, `[b·m]`; each sees
    /// all earlier and all new positions.
    pub fn join(&mut self, x_nd: Tensor<2>, angles: &[usize]) -> Tensor<2> {
        self.joined += angles.len() / self.prefixes.len();
        self.pass(x_nd, self.joining(angles))
    }

    fn pass(&mut self, x_nd: Tensor<2>, joining: Joining) -> Tensor<2> {
        self.blocks.iter().zip(&mut self.kept).fold(x_nd, |x_nd, (block, kept)| {
            let x_nd = joining.attention(x_nd, block.attention(), kept, EPSILON);
            self.backbone.feed_forward(block, x_nd)
        })
    }

    fn joining(&self, angles: &[usize]) -> Joining {
        let p = self.longest_text();
        let is_padding = |prefix: &usize| {
            let prefix = *prefix;
            (0..p + self.joined).map(move |slot| slot >= prefix && slot < p)
        };
        let padding: Vec<bool> = self.prefixes.iter().flat_map(is_padding).collect();
        let Backbone { rope, shape, device, .. } = self.backbone;
        Joining::new(rope, shape.n_head, self.prefixes.len(), angles, &padding, device)
    }
}

/// Rows side by side, each filled up with zeros to `width`.
pub fn padded(rows: &[&[f32]], width: usize) -> Vec<f32> {
    let mut values = vec![0.0; rows.len() * width];
    for (to, from) in values.chunks_exact_mut(width).zip(rows) {
        to[..from.len()].copy_from_slice(from);
    }
    values
}

/// The sources of the rows of packed sequences, given the number of rows of each sort per sequence: rows are stored sort
/// by sort over all sequences. Also their lengths.
pub fn packed<const N: usize>(sizes: &[[usize; N]]) -> (Arc<[u32]>, Vec<usize>) {
    let mut next = [0; N];
    for sort in 1..N {
        next[sort] = next[sort - 1] + sizes.iter().map(|own| own[sort - 1]).sum::<usize>();
    }
    let mut order = Vec::new();
    for own in sizes {
        for (next, n) in next.iter_mut().zip(own) {
            order.extend((*next..*next + n).map(|row| row as u32));
            *next += n;
        }
    }
    (order.into(), sizes.iter().map(|own| own.iter().sum()).collect())
}
