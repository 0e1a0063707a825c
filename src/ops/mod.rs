//! The operations of the transformer that burn composes slowly on the CPU, each in two versions.
//!
//! [`Kernels::Own`] are hand-written for the device `flex`, with hand-written gradients;
//! [`Kernels::Plain`] are composed of burn's operations and run everywhere. The tests hold each
//! to the other and both to finite differences.
//!
//! Activations are two-dimensional and packed without padding: the rows of a batch are the
//! positions of its sequences, one sequence after another, as a [`SequenceLayout`] says. Tensors
//! carry their shape as a suffix: n rows, m rows to pick from, d features, f hidden features of
//! the feed-forward layer, v codes. A gradient by x is written ∂x, and g is the one by the output.

use std::sync::Arc;

use burn::backend::Dispatch;
use burn::tensor::{Device, Tensor};

mod layout;
mod own;
mod plain;
mod rope;
#[cfg(test)]
mod tests;

pub use layout::{LayoutError, SequenceLayout};
pub use rope::Rope;

use own::OwnOps;

/// Which implementation of the operations to use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kernels {
    /// Hand-written kernels, on the device `flex` and in `f32` only. Single-threaded, and the
    /// same input gives the same bits.
    Own,
    /// Burn's operations, on any device.
    Plain,
}

impl Kernels {
    /// The faster implementation that runs on `device`, with or without autodiff.
    pub fn for_device(device: &Device) -> Self {
        if *device == Device::flex() { Kernels::Own } else { Kernels::Plain }
    }

    /// Root-mean-square normalisation with a learned scale (Zhang and Sennrich 2019).
    ///
    /// y = x r γ with r = 1 / √(mean(x²) + ε) in each row;
    /// ∂x = r (g γ − x r² mean(g γ x)), ∂γ = Σ over rows of g x r.
    ///
    /// # Panics
    ///
    /// If `gamma_d` has not one element for each column of `x_nd`.
    pub fn rms_norm(self, x_nd: Tensor<2>, gamma_d: Tensor<1>, epsilon: f32) -> Tensor<2> {
        let ([_, columns], [d]) = (x_nd.dims(), gamma_d.dims());
        assert_eq!(columns, d, "rms_norm: gamma has {d} elements for rows of {columns}");
        match self {
            Kernels::Plain => plain::rms_norm(x_nd, gamma_d, epsilon),
            Kernels::Own => Tensor::from_dispatch(Dispatch::own_rms_norm(
                x_nd.into_dispatch(),
                gamma_d.into_dispatch(),
                epsilon,
            )),
        }
    }

    /// Multi-head attention with rotary positions and a bidirectional text prefix (ScaMo §3.2).
    ///
    /// `qkv_n3d` has the columns `[q | k | v]`, each d = n_head · head_dim wide, head after head.
    /// In each head of each sequence, with q̂ and k̂ turned by [`Rope`],
    ///
    /// W = softmax(q̂ k̂ᵀ / √head_dim) over the positions that [`SequenceLayout`] lets each row
    /// see, y = W v;
    /// ∂v = Wᵀ g, S = W ∘ (g vᵀ − rowsum(W ∘ g vᵀ)), ∂q̂ = S k̂ / √head_dim,
    /// ∂k̂ = Sᵀ q̂ / √head_dim, and ∂q, ∂k are turned back.
    ///
    /// Returns `[n, d]`.
    ///
    /// # Panics
    ///
    /// If the shape of `qkv_n3d` is not that of the layout, heads and angles, or if a sequence
    /// has more positions than `rope` has angles.
    pub fn attention(
        self,
        qkv_n3d: Tensor<2>,
        n_head: usize,
        layout: &Arc<SequenceLayout>,
        rope: &Arc<Rope>,
    ) -> Tensor<2> {
        check_attention(qkv_n3d.dims(), n_head, layout, rope);
        match self {
            Kernels::Plain => plain::attention(qkv_n3d, n_head, layout, rope),
            Kernels::Own => Tensor::from_dispatch(Dispatch::own_attention(
                qkv_n3d.into_dispatch(),
                n_head,
                layout.clone(),
                rope.clone(),
            )),
        }
    }

    /// The gated activation of LLaMA's feed-forward layer (Shazeer 2020).
    ///
    /// `gate_up_n2f` has the columns `[gate | up]`; with σ the logistic function of gate,
    /// y = gate σ up; ∂gate = g up σ (1 + gate (1 − σ)), ∂up = g gate σ. Returns `[n, f]`.
    ///
    /// # Panics
    ///
    /// If the number of columns is odd.
    pub fn swiglu(self, gate_up_n2f: Tensor<2>) -> Tensor<2> {
        let [_, columns] = gate_up_n2f.dims();
        assert!(columns.is_multiple_of(2), "swiglu: {columns} columns are not [gate | up]");
        match self {
            Kernels::Plain => plain::swiglu(gate_up_n2f),
            Kernels::Own => {
                Tensor::from_dispatch(Dispatch::own_swiglu(gate_up_n2f.into_dispatch()))
            }
        }
    }

    /// Mean cross-entropy of the rows' softmax against one target a row, in nats.
    ///
    /// L = mean of (ln Σ e^logit − logit of the target), without keeping log-probabilities;
    /// ∂logits = g (softmax(logits) − onehot(target)) / n.
    ///
    /// # Panics
    ///
    /// If there is not one target for each row, no row at all, or a target beyond the columns.
    pub fn cross_entropy(self, logits_nv: Tensor<2>, targets: &Arc<[u32]>) -> Tensor<1> {
        check_targets(logits_nv.dims(), targets);
        match self {
            Kernels::Plain => plain::cross_entropy(logits_nv, targets),
            Kernels::Own => Tensor::from_dispatch(Dispatch::own_cross_entropy(
                logits_nv.into_dispatch(),
                targets.clone(),
            )),
        }
    }

    /// Cross-entropy of each row, in nats, outside autodiff; [`Kernels::Own`] sums in `f64`.
    ///
    /// # Panics
    ///
    /// As [`Kernels::cross_entropy`].
    pub fn nll(self, logits_nv: Tensor<2>, targets: &[u32]) -> Vec<f64> {
        let [n, n_vocab] = logits_nv.dims();
        check_targets([n, n_vocab], targets);
        match self {
            Kernels::Plain => plain::nll(logits_nv, targets),
            Kernels::Own => {
                let data = logits_nv.without_autodiff().into_data();
                let logits = data.as_slice::<f32>().expect("the own operations compute in f32");
                own::losses(logits, targets, &own::log_normalisers(logits, n_vocab))
            }
        }
    }

    /// Rows of a matrix, in the order given and as often as given: an embedding's forward, and
    /// the rows that a loss is taken on.
    ///
    /// yᵢ = x_rows(i); ∂x_j = Σ over i with rows(i) = j of gᵢ, added in the order of i.
    ///
    /// # Panics
    ///
    /// If a row is beyond the last.
    pub fn select_rows(self, x_md: Tensor<2>, rows: &Arc<[u32]>) -> Tensor<2> {
        let [m, _] = x_md.dims();
        let last = rows.iter().max().map_or(0, |&last| last as usize);
        assert!(last < m, "select_rows: row {last} of a matrix of {m}");
        match self {
            Kernels::Plain => plain::select_rows(x_md, rows),
            Kernels::Own => {
                Tensor::from_dispatch(Dispatch::own_select_rows(x_md.into_dispatch(), rows.clone()))
            }
        }
    }
}

fn check_attention([n, columns]: [usize; 2], n_head: usize, layout: &SequenceLayout, rope: &Rope) {
    let (rows, head_dim) = (layout.n_rows(), rope.head_dim());
    assert_eq!(n, rows, "attention: {n} rows for a layout of {rows}");
    assert_eq!(
        columns,
        3 * n_head * head_dim,
        "attention: {columns} columns are not [q | k | v] of {n_head} heads of {head_dim}"
    );
    let (longest, max_len) = (layout.max_len(), rope.max_len());
    assert!(longest <= max_len, "attention: {longest} positions, angles for {max_len}");
}

fn check_targets([n, n_vocab]: [usize; 2], targets: &[u32]) {
    assert!(n > 0, "cross_entropy: no rows to average over");
    assert_eq!(n, targets.len(), "cross_entropy: {} targets for {n} rows", targets.len());
    let largest = targets.iter().max().map_or(0, |&target| target as usize);
    assert!(largest < n_vocab, "cross_entropy: target {largest} in a vocabulary of {n_vocab}");
}
