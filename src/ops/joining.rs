//! Attention of positions that join sequences piece by piece, as in sampling: the keys and values of
//! the positions before them are kept.
//!
//! Shapes: b sequences, m positions that join each, t positions of each with those that join,
//! n = b m rows, d features, h heads, c features of a head.

use burn::tensor::activation::softmax;
use burn::tensor::{Bool, Device, Tensor, TensorData};

use super::plain::{MASKED, rms_norm, turn};
use super::{AttentionWeights, Rope};

/// The keys, turned by their positions, and the values of one block, each `[b, h, t, c]`.
#[derive(Clone, Debug, Default)]
pub struct KeyValues(Option<[Tensor<4>; 2]>);

impl KeyValues {
    /// Adds those of the positions that join, and gives all.
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

/// Positions that join every sequence of a batch at once. Each sees all positions before it, its own,
/// and those that join beside it, but for padding.
#[derive(Clone, Debug)]
pub struct Joining {
    n_head: usize,
    /// Cosines and sines of their angles, `[b, 1, m, c / 2, 1]`.
    turns: [Tensor<5>; 2],
    /// True where a position is padding, `[b, 1, 1, t]`.
    padding_b11t: Tensor<4, Bool>,
}

impl Joining {
    /// Positions by their rows of `rope`, `[b, m]`, and which of all positions so far, these
    /// included, are padding, `[b, t]`; both row-major.
    ///
    /// # Panics
    /// If a list is no multiple of the number of sequences, or a position has no angle.
    pub fn new(
        rope: &Rope,
        n_head: usize,
        n_sequences: usize,
        positions: &[usize],
        padding: &[bool],
        device: &Device,
    ) -> Self {
        let (b, pairs) = (n_sequences, rope.head_dim() / 2);
        let (m, t) = (positions.len() / b, padding.len() / b);
        assert!(b * m == positions.len() && b * t == padding.len(), "a row a sequence");
        let angles = |of: fn(&Rope, usize) -> &[f32]| {
            let values: Vec<f32> =
                positions.iter().flat_map(|&position| of(rope, position)).copied().collect();
            Tensor::from_data(TensorData::new(values, [b, 1, m, pairs, 1]), device)
        };
        let padding = TensorData::new(padding.to_vec(), [b, 1, 1, t]);
        Self {
            n_head,
            turns: [angles(|rope, t| rope.turn(t).0), angles(|rope, t| rope.turn(t).1)],
            padding_b11t: Tensor::from_data(padding, device),
        }
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
        let [keys, values] = kept.join([self.turned(keys), values]);
        let c = d / self.n_head;
        let queries = self.turned(queries).div_scalar((c as f64).sqrt());
        let scores_bhmt = queries.matmul(keys.swap_dims(2, 3));
        let hidden_bhmt = self.padding_b11t.clone().expand(scores_bhmt.dims());
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

    fn turned(&self, x_bhmc: Tensor<4>) -> Tensor<4> {
        turn(x_bhmc, &self.turns)
    }
}
