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
/// and those that join beside it, but for those that are hidden from it.
#[derive(Clone, Debug)]
pub struct Joining {
    n_head: usize,
    /// Cosines and sines of their angles, `[b, 1, m, c / 2, 1]`.
    turns: [Tensor<5>; 2],
    /// True where a position is hidden, `[b, 1, 1, t]`, or `[b, 1, m, t]` where it is from some.
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

    /// Hides the first `n` positions of every sequence from some of those that join, `[b, m]` row-major.
    pub fn hiding(self, n: usize, from: &[bool]) -> Self {
        let [b, .., t] = self.hidden.dims();
        let m = from.len() / b;
        let hide =
            from.iter().flat_map(|&is_hidden| (0..t).map(move |place| is_hidden && place < n));
        let data = TensorData::new(hide.collect::<Vec<bool>>(), [b, 1, m, t]);
        let hide = Tensor::from_data(data, &self.hidden.device());
        Self { hidden: self.hidden.expand([b, 1, m, t]).bool_or(hide), ..self }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Two positions that join two others: the values of the first two are `before`; the first that
    /// joins sees nothing of them.
    fn joined(before: [f32; 2]) -> Vec<f32> {
        let device = Device::flex();
        let rope = Rope::new(4, 2, 10_000.0);
        let matrix = |values: &[f32], shape| {
            Tensor::<2>::from_data(TensorData::new(values.to_vec(), shape), &device)
        };
        let weights = || AttentionWeights {
            gamma_d: Tensor::ones([2], &device),
            qkv_d3d: matrix(
                &[0.3, 1.0, -0.4, 0.6, 0.9, 0.1, 0.7, -0.2, 0.5, 1.1, -0.8, 0.4],
                [2, 6],
            ),
            output_dd: matrix(&[1.0, 0.5, -0.5, 1.0], [2, 2]),
        };
        let mut kept = KeyValues::default();
        let first = Joining::new(&rope, 1, 1, &[0, 1], &[false; 2], &device);
        first.attention(
            matrix(&[before[0], 1.0, before[1], -1.0], [2, 2]),
            weights(),
            &mut kept,
            1e-5,
        );
        let second = Joining::new(&rope, 1, 1, &[2, 3], &[false; 4], &device);
        let second = second.hiding(2, &[true, false]);
        let x_nd = matrix(&[0.2, 0.9, -1.3, 0.4], [2, 2]);
        let y_nd = second.attention(x_nd, weights(), &mut kept, 1e-5);
        y_nd.into_data().try_into_vec().expect("f32")
    }

    #[test]
    fn what_is_hidden_from_a_position_does_not_reach_it() {
        let (a, b) = (joined([0.5, -0.7]), joined([-2.0, 1.4]));
        assert_eq!(a[..2], b[..2]);
        assert!(a[2] != b[2] && a[3] != b[3], "{a:?} {b:?}");
    }
}
