//! Attention composed of burn's operations: of sequences, to a memory, and of positions that join
//! sequences piece by piece, as in sampling.
//!
//! Shapes: n rows, d features, b sequences, h heads, t positions of the longest sequence, c features of a
//! head.

use burn::tensor::activation::softmax;
use burn::tensor::{Bool, Device, Tensor, TensorData};

use super::{Product, rms_norm};
use crate::ops::padded::{PaddedBatch, PaddedPair};
use crate::ops::{AttentionOptions, AttentionWeights, CrossOptions, Rope};

/// Stands for minus infinity in masked scores: e to it is zero, and it is an ordinary number on
/// devices whose arithmetic has no infinities.
const MASKED: f32 = -1e30;

/// See [`Kernels::attention`](crate::ops::Kernels::attention).
pub fn attention_half(
    x_nd: Tensor<2>,
    weights: AttentionWeights,
    options: &AttentionOptions,
    product: Product,
) -> Tensor<2> {
    let normed_nd = rms_norm(x_nd.clone(), weights.gamma_d, options.epsilon);
    let qkv_n3d = product.of(normed_nd, weights.qkv_d3d);
    let mixed_nd = attend(qkv_n3d, options, product);
    x_nd + product.of(mixed_nd, weights.output_dd)
}

/// Attention of `[q | k | v]`, before the projection: pads the sequences to one length,
/// attends densely under a mask, and takes the padding out again.
pub fn attend(qkv_n3d: Tensor<2>, options: &AttentionOptions, product: Product) -> Tensor<2> {
    let AttentionOptions { n_head, layout, rope, .. } = options;
    let n_head = *n_head;
    let (b, t, c) = (layout.n_sequences(), layout.max_len(), rope.head_dim());
    let d = n_head * c;
    let PaddedBatch { rows, positions, turns, hidden } = options.padded(&qkv_n3d.device());
    let padded = qkv_n3d.select(0, rows);
    let part_bhtc = |part: usize| {
        let columns = padded.clone().slice([0..b * t, part * d..(part + 1) * d]);
        columns.reshape([b, t, n_head, c]).swap_dims(1, 2)
    };
    let queries_bhtc = turn(part_bhtc(0), &turns).div_scalar((c as f64).sqrt());
    let scores_bhtt = product.of(queries_bhtc, turn(part_bhtc(1), &turns).swap_dims(2, 3));
    let hidden_bhtt = hidden.expand([b, n_head, t, t]);
    let weights_bhtt = softmax(scores_bhtt.mask_fill(hidden_bhtt, MASKED), 3);
    let output = product.of(weights_bhtt, part_bhtc(2)).swap_dims(1, 2).reshape([b * t, d]);
    output.select(0, positions)
}

/// Turns the pairs of features by angles whose cosines and sines are `[b or 1, 1, t, c / 2, 1]`.
fn turn(x_bhtc: Tensor<4>, [cos, sin]: &[Tensor<5>; 2]) -> Tensor<4> {
    let [b, h, t, c] = x_bhtc.dims();
    let pairs = x_bhtc.reshape([b, h, t, c / 2, 2]);
    let even = pairs.clone().slice([0..b, 0..h, 0..t, 0..c / 2, 0..1]);
    let odd = pairs.slice([0..b, 0..h, 0..t, 0..c / 2, 1..2]);
    let turned_even = even.clone().mul(cos.clone()).sub(odd.clone().mul(sin.clone()));
    let turned_odd = even.mul(sin.clone()).add(odd.mul(cos.clone()));
    Tensor::cat(vec![turned_even, turned_odd], 4).reshape([b, h, t, c])
}

// Attention to a memory.

/// See [`Kernels::cross_attend`](crate::ops::Kernels::cross_attend): pads queries and memories to one length if they
/// differ.
pub fn cross_attend(
    queries_nd: Tensor<2>,
    key_values_m2d: Tensor<2>,
    options: &CrossOptions,
    product: Product,
) -> Tensor<2> {
    let CrossOptions { n_head, layout, .. } = options;
    let d = queries_nd.dims()[1];
    let (b, c) = (layout.n_sequences(), d / n_head);
    let PaddedPair { queries: of_queries, memory, hidden, turns } =
        options.padded(&queries_nd.device());
    let padded_md = memory.pad(key_values_m2d);
    let by_head = |x_nd: Tensor<2>| {
        let t = x_nd.dims()[0] / b;
        x_nd.reshape([b, t, *n_head, c]).swap_dims(1, 2)
    };
    let part = |part: usize| by_head(padded_md.clone().narrow(1, part * d, d));
    let (mut queries, mut keys) = (by_head(of_queries.pad(queries_nd)), part(0));
    if let Some([at_queries, at_memory]) = turns {
        (queries, keys) = (turn(queries, &at_queries), turn(keys, &at_memory));
    }
    let scores = product.of(queries.div_scalar((c as f64).sqrt()), keys.swap_dims(2, 3));
    let scores = match hidden {
        Some(hidden) => scores.clone().mask_fill(hidden.expand(scores.dims()), MASKED),
        None => scores,
    };
    let mixed = product.of(softmax(scores, 3), part(1)).swap_dims(1, 2);
    let [_, t, ..] = mixed.dims();
    of_queries.unpad(mixed.reshape([b * t, d]))
}

// Growing sequences: keys and values of earlier positions are cached.
//
// Shapes: m new positions per sequence, t positions of each including new ones, n = b m rows.

/// The keys, turned by their positions, and the values of one block, each `[b, h, t, c]`.
#[derive(Clone, Debug, Default)]
pub struct KeyValues(Option<[Tensor<4>; 2]>);

impl KeyValues {
    /// Adds those of new positions, and returns all.
    fn join(&mut self, new: [Tensor<4>; 2]) -> [Tensor<4>; 2] {
        let all = match self.0.take() {
            None => new,
            Some([keys, values]) => {
                let [new_keys, new_values] = new;
                [Tensor::cat(vec![keys, new_keys], 2), Tensor::cat(vec![values, new_values], 2)]
            }
        };
        self.0.insert(all).clone()
    }
}

/// New positions of every sequence of a batch. Each attends to all earlier and all new positions, except hidden
/// ones.
#[derive(Clone, Debug)]
pub struct Joining {
    n_head: usize,
    /// Cosines and sines of their angles, `[b, 1, m, c / 2, 1]`.
    turns: [Tensor<5>; 2],
    /// True for hidden positions, `[b, 1, 1, t]`, or `[b, 1, m, t]` if hidden only from some.
    hidden: Tensor<4, Bool>,
}

impl Joining {
    /// Positions by their rows of `rope`, `[b, m]`, and which of all positions so far, these
    /// included, are hidden from all that join, as padding is, `[b, t]`; both row-major.
    ///
    /// # Panics
    /// If a list is no multiple of the number of sequences, or a position has no angle.
    pub fn new(
        rope: &Rope,
        n_head: usize,
        n_sequences: usize,
        positions: &[usize],
        hidden: &[bool],
        device: &Device,
    ) -> Self {
        let b = n_sequences;
        let (m, t) = (positions.len() / b, hidden.len() / b);
        assert!(b * m == positions.len() && b * t == hidden.len(), "a row a sequence");
        let hidden = Tensor::from_data(TensorData::new(hidden.to_vec(), [b, 1, 1, t]), device);
        Self { n_head, turns: rope.turns(b, positions, device), hidden }
    }

    /// The attention half of a block for the rows of the positions that join, sequence after
    /// sequence: y = x + Attention(RMSNorm(x) W_qkv) W_output, `[n, d]`. Outside autodiff.
    pub fn attention(
        &self,
        x_nd: Tensor<2>,
        weights: AttentionWeights,
        kept: &mut KeyValues,
        epsilon: f32,
    ) -> Tensor<2> {
        let [n, d] = x_nd.dims();
        let qkv_n3d = rms_norm(x_nd.clone(), weights.gamma_d, epsilon).matmul(weights.qkv_d3d);
        let [queries, keys, values] = [0, 1, 2].map(|part| self.heads(&qkv_n3d, part));
        let [keys, values] = kept.join([turn(keys, &self.turns), values]);
        let c = d / self.n_head;
        let queries = turn(queries, &self.turns).div_scalar((c as f64).sqrt());
        let scores_bhmt = queries.matmul(keys.swap_dims(2, 3));
        let hidden_bhmt = self.hidden.clone().expand(scores_bhmt.dims());
        let weights_bhmt = softmax(scores_bhmt.mask_fill(hidden_bhmt, MASKED), 3);
        let mixed_nd = weights_bhmt.matmul(values).swap_dims(1, 2).reshape([n, d]);
        x_nd + mixed_nd.matmul(weights.output_dd)
    }

    /// Queries, keys or values by head, `[b, h, m, c]`.
    fn heads(&self, qkv_n3d: &Tensor<2>, part: usize) -> Tensor<4> {
        let [n, columns] = qkv_n3d.dims();
        let [b, _, m, ..] = self.turns[0].dims();
        let d = columns / 3;
        let part_nd = qkv_n3d.clone().slice([0..n, part * d..(part + 1) * d]);
        part_nd.reshape([b, m, self.n_head, d / self.n_head]).swap_dims(1, 2)
    }
}
