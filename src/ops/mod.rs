//! The operations of the models that burn composes slowly on the CPU, each in two versions.
//!
//! [`Kernels::Own`] are hand-written for the device `flex`, with hand-written gradients;
//! [`Kernels::Plain`] are composed of burn's operations and run everywhere. The tests hold each
//! to the other and both to finite differences.
//!
//! Activations are two-dimensional and packed without padding: the rows of a batch are the
//! positions of its sequences, one sequence after another, as a [`SequenceLayout`] says. Tensors
//! carry their shape as a suffix: n rows, s rows that a loss is taken on, m rows to pick from,
//! d features, f hidden features of the feed-forward layer, u columns before its activation,
//! v codes; of convolutions, k taps and c channels that become o. A gradient by x is written ∂x, and g is the one by the output.
//!
//! RMSNorm (Zhang and Sennrich 2019) stands at the start of each part of the model:
//! RMSNorm(x) = x r γ with r = 1 / √(mean(x²) + ε) in each row;
//! ∂x = r (g γ − x r² mean(g γ x)), ∂γ = Σ over rows of g x r.

use std::sync::Arc;

use burn::backend::Dispatch;
use burn::tensor::{Device, FloatDType, Tensor};

mod check;
mod convolution;
mod layout;
mod own;
mod plain;
mod rope;
#[cfg(test)]
mod tests;

pub use check::{WrongProduct, check_products};
pub use convolution::{Convolution, Taps};
pub use layout::{LayoutError, SequenceLayout};
pub use own::AdamWStep;
pub use rope::Rope;

use own::{OwnOps, OwnUpdates};

/// Which implementation of the operations to use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kernels {
    /// Hand-written kernels, on the device `flex` and in `f32` only. Single-threaded, and the
    /// same input gives the same bits.
    Own,
    /// Burn's operations, on any device.
    Plain,
    /// The same with the products of matrices in a half precision, on devices that compute in it;
    /// what goes in and comes out is `f32`.
    Half(HalfFloat),
}

/// A number of sixteen bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HalfFloat {
    F16,
    Bf16,
}

impl HalfFloat {
    /// The same type as burn calls it.
    pub fn dtype(self) -> FloatDType {
        match self {
            HalfFloat::F16 => FloatDType::F16,
            HalfFloat::Bf16 => FloatDType::BF16,
        }
    }
}

/// What attention is told beside its tensors.
#[derive(Debug, Clone)]
pub struct AttentionOptions {
    pub n_head: usize,
    /// Where the sequences of the batch begin, and who sees whom.
    pub layout: Arc<SequenceLayout>,
    /// Angles of the positions.
    pub rope: Arc<Rope>,
    /// RMSNorm's ε.
    pub epsilon: f32,
}

/// Parameters of the attention half of a block.
#[derive(Debug, Clone)]
pub struct AttentionWeights {
    /// RMSNorm's scale.
    pub gamma_d: Tensor<1>,
    pub qkv_d3d: Tensor<2>,
    pub output_dd: Tensor<2>,
}

/// Parameters of the feed-forward half of a block.
#[derive(Debug, Clone)]
pub struct FeedForwardWeights {
    /// RMSNorm's scale.
    pub gamma_d: Tensor<1>,
    /// u is what the activation wants.
    pub up_du: Tensor<2>,
    pub down_fd: Tensor<2>,
}

/// Parameters of the head.
#[derive(Debug, Clone)]
pub struct HeadWeights {
    /// RMSNorm's scale.
    pub gamma_d: Tensor<1>,
    pub weight_dv: Tensor<2>,
}

/// What stands between the two products of a feed-forward layer of f hidden features.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Activation {
    /// LLaMA's gated one (Shazeer 2020), of u = 2 f columns `[gate | up]`; with σ the logistic
    /// function of gate, y = gate σ up; ∂gate = g up σ (1 + gate (1 − σ)), ∂up = g gate σ.
    SwiGlu,
    /// x Φ(x), with Φ(x) = (1 + erf(x / √2)) / 2 (Hendrycks and Gimpel 2016), of u = f columns;
    /// ∂x = g (Φ(x) + x φ(x)).
    Gelu,
}

impl Kernels {
    /// The faster implementation that runs on `device`, with or without autodiff.
    pub fn for_device(device: &Device) -> Self {
        if *device == Device::flex() { Kernels::Own } else { Kernels::Plain }
    }

    /// What burn's products of matrices are computed by.
    fn product(self) -> plain::Product {
        match self {
            Kernels::Half(half) => plain::Product::In(half.dtype()),
            Kernels::Own | Kernels::Plain => plain::Product::Single,
        }
    }

    /// The attention half of a block: multi-head attention with rotary positions and a
    /// bidirectional text prefix (ScaMo §3.2), y = x + Attention(RMSNorm(x) W_qkv) W_output.
    ///
    /// The columns of W_qkv are `[q | k | v]`, each d = n_head · head_dim wide, head after head.
    /// In each head of each sequence, with q̂ and k̂ turned by [`Rope`],
    ///
    /// W = softmax(q̂ k̂ᵀ / √head_dim) over the positions that [`SequenceLayout`] lets each row
    /// see, a = W v;
    /// ∂v = Wᵀ g, S = W ∘ (g vᵀ − rowsum(W ∘ g vᵀ)), ∂q̂ = S k̂ / √head_dim,
    /// ∂k̂ = Sᵀ q̂ / √head_dim, and ∂q, ∂k are turned back.
    ///
    /// Returns `[n, d]`.
    ///
    /// # Panics
    ///
    /// If the shapes are not those of the layout, heads and angles, or if a sequence has more
    /// positions than `rope` has angles.
    pub fn attention(
        self,
        x_nd: Tensor<2>,
        weights: AttentionWeights,
        options: &AttentionOptions,
    ) -> Tensor<2> {
        check_attention(x_nd.dims(), weights.qkv_d3d.dims(), options);
        match self {
            Kernels::Plain | Kernels::Half(_) => {
                plain::attention_half(x_nd, weights, options, self.product())
            }
            Kernels::Own => Tensor::from_dispatch(Dispatch::own_attention(
                x_nd.into_dispatch(),
                weights.gamma_d.into_dispatch(),
                weights.qkv_d3d.into_dispatch(),
                weights.output_dd.into_dispatch(),
                options.clone(),
            )),
        }
    }

    /// The feed-forward half of a block: y = x + [`Activation`](RMSNorm(x) W_up) W_down, `[n, d]`.
    ///
    /// # Panics
    ///
    /// If the shapes do not fit one another and the activation.
    pub fn feed_forward(
        self,
        x_nd: Tensor<2>,
        weights: FeedForwardWeights,
        activation: Activation,
        epsilon: f32,
    ) -> Tensor<2> {
        check_feed_forward(x_nd.dims(), weights.up_du.dims(), weights.down_fd.dims(), activation);
        match self {
            Kernels::Plain | Kernels::Half(_) => {
                plain::feed_forward_half(x_nd, weights, activation, epsilon, self.product())
            }
            Kernels::Own => Tensor::from_dispatch(Dispatch::own_feed_forward(
                x_nd.into_dispatch(),
                weights.gamma_d.into_dispatch(),
                weights.up_du.into_dispatch(),
                weights.down_fd.into_dispatch(),
                activation,
                epsilon,
            )),
        }
    }

    /// Mean cross-entropy of softmax(RMSNorm(x) W) against one target a row, in nats, `[1]`.
    ///
    /// L = mean of (ln Σ e^logit − logit of the target);
    /// ∂logits = g (softmax(logits) − onehot(target)) / s. [`Kernels::Own`] keeps no tensor of
    /// logits, and has the gradients ready with the loss.
    ///
    /// # Panics
    ///
    /// If there is not one target for each row, no row at all, or a target beyond the columns.
    pub fn head_loss(
        self,
        x_sd: Tensor<2>,
        weights: HeadWeights,
        targets: &Arc<[u32]>,
        epsilon: f32,
    ) -> Tensor<1> {
        check_targets([x_sd.dims()[0], weights.weight_dv.dims()[1]], targets);
        match self {
            Kernels::Plain | Kernels::Half(_) => {
                let logits_sv = plain::logits(x_sd, weights, epsilon, self.product());
                plain::cross_entropy(logits_sv, targets)
            }
            Kernels::Own => Tensor::from_dispatch(Dispatch::own_head_loss(
                x_sd.into_dispatch(),
                weights.gamma_d.into_dispatch(),
                weights.weight_dv.into_dispatch(),
                targets.clone(),
                epsilon,
            )),
        }
    }

    /// Cross-entropy of each row, in nats, outside autodiff; [`Kernels::Own`] sums in `f64`.
    ///
    /// # Panics
    ///
    /// As [`Kernels::head_loss`].
    pub fn head_nll(
        self,
        x_sd: Tensor<2>,
        weights: HeadWeights,
        targets: &Arc<[u32]>,
        epsilon: f32,
    ) -> Vec<f64> {
        check_targets([x_sd.dims()[0], weights.weight_dv.dims()[1]], targets);
        match self {
            Kernels::Plain | Kernels::Half(_) => {
                plain::nll(plain::logits(x_sd, weights, epsilon, self.product()), targets)
            }
            Kernels::Own => sums_of_parts(Tensor::<2>::from_dispatch(Dispatch::own_head_nll(
                x_sd.without_autodiff().into_dispatch(),
                weights.gamma_d.without_autodiff().into_dispatch(),
                weights.weight_dv.without_autodiff().into_dispatch(),
                targets.clone(),
                epsilon,
            ))),
        }
    }

    /// A convolution over the frames of clips, with ρ the identity or max(·, 0) as asked for:
    /// yᵢ = b + Σ over taps j of ρ(x_s(i, j)) W_j, where [`Taps`] says which row s(i, j) is, and
    /// rows beyond the clip are zero. W is `[k c, o]`, the earliest tap first.
    ///
    /// ∂x_r = ρ'(x_r) Σ over i, j with s(i, j) = r of gᵢ W_jᵀ, ∂W_j = Σᵢ ρ(x_s(i, j))ᵀ gᵢ,
    /// ∂b = Σᵢ gᵢ.
    ///
    /// # Panics
    ///
    /// If the shapes do not fit one another, or an odd number of frames is to be halved.
    pub fn convolve(
        self,
        x_nc: Tensor<2>,
        weight: Tensor<2>,
        bias_o: Tensor<1>,
        convolution: Convolution,
    ) -> Tensor<2> {
        check_convolution(x_nc.dims(), weight.dims(), bias_o.dims(), convolution);
        match self {
            Kernels::Plain | Kernels::Half(_) => {
                plain::convolve(x_nc, weight, bias_o, convolution, self.product())
            }
            Kernels::Own => Tensor::from_dispatch(Dispatch::own_convolve(
                x_nc.into_dispatch(),
                weight.into_dispatch(),
                bias_o.into_dispatch(),
                convolution,
            )),
        }
    }

    /// Logits over the columns of W, RMSNorm(x) W, `[s, v]`, by burn's operations on any device.
    pub fn logits(self, x_sd: Tensor<2>, weights: HeadWeights, epsilon: f32) -> Tensor<2> {
        plain::logits(x_sd, weights, epsilon, self.product())
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
            Kernels::Plain | Kernels::Half(_) => plain::select_rows(x_md, rows),
            Kernels::Own => {
                Tensor::from_dispatch(Dispatch::own_select_rows(x_md.into_dispatch(), rows.clone()))
            }
        }
    }
}

/// Σ x² of a tensor outside autodiff.
pub fn sum_of_squares(x: Tensor<1>) -> f64 {
    if Kernels::for_device(&x.device()) == Kernels::Own {
        sums_of_parts(Tensor::<1>::from_dispatch(Dispatch::own_sum_of_squares(x.into_dispatch())))
            [0]
    } else {
        f64::from((x.clone() * x).sum().into_scalar::<f32>())
    }
}

/// A parameter and both its moments after a step of AdamW, all of one length and outside autodiff.
pub fn adamw(
    value: Tensor<1>,
    gradient: Tensor<1>,
    [first, second]: [Tensor<1>; 2],
    step: AdamWStep,
) -> (Tensor<1>, [Tensor<1>; 2]) {
    if Kernels::for_device(&value.device()) != Kernels::Own {
        return plain::adamw(value, gradient, [first, second], step);
    }
    let (value, first, second) = Dispatch::own_adamw(
        value.into_dispatch(),
        gradient.into_dispatch(),
        first.into_dispatch(),
        second.into_dispatch(),
        step,
    );
    let [value, first, second] = [value, first, second].map(Tensor::from_dispatch);
    (value, [first, second])
}

/// Numbers that come as a large and a small part each.
fn sums_of_parts<const D: usize>(parts: Tensor<D>) -> Vec<f64> {
    let data = parts.into_data();
    let parts = data.as_slice::<f32>().expect("the own operations compute in f32");
    parts.as_chunks().0.iter().map(|&[large, small]| f64::from(large) + f64::from(small)).collect()
}

fn check_attention(
    [n, d]: [usize; 2],
    [_, columns]: [usize; 2],
    AttentionOptions { n_head, layout, rope, .. }: &AttentionOptions,
) {
    let (rows, head_dim) = (layout.n_rows(), rope.head_dim());
    assert_eq!(n, rows, "attention: {n} rows for a layout of {rows}");
    assert!(
        d == n_head * head_dim && columns == 3 * d,
        "attention: {columns} columns are not [q | k | v] of {n_head} heads of {head_dim}"
    );
    let (longest, max_len) = (layout.max_len(), rope.max_len());
    assert!(longest <= max_len, "attention: {longest} positions, angles for {max_len}");
}

fn check_feed_forward(
    [_, d]: [usize; 2],
    [rows, u]: [usize; 2],
    [f, columns]: [usize; 2],
    activation: Activation,
) {
    let wanted = match activation {
        Activation::SwiGlu => 2 * f,
        Activation::Gelu => f,
    };
    assert_eq!(
        [rows, columns, u],
        [d, d, wanted],
        "feed_forward: rows of {d}, {f} hidden features"
    );
}

fn check_convolution(
    [n, c]: [usize; 2],
    [rows, o]: [usize; 2],
    [columns]: [usize; 1],
    Convolution { n_clips, taps, .. }: Convolution,
) {
    assert_eq!([rows, o], [taps.count() * c, columns], "convolve: {c} channels, {taps:?}");
    assert!(n_clips > 0 && n.is_multiple_of(n_clips), "convolve: {n} rows of {n_clips} clips");
    let whole = taps != Taps::Halving || (n / n_clips).is_multiple_of(2);
    assert!(whole, "clips are cropped to whole tokens before they are encoded");
}

fn check_targets([n, n_vocab]: [usize; 2], targets: &[u32]) {
    assert!(n > 0, "cross_entropy: no rows to average over");
    assert_eq!(n, targets.len(), "cross_entropy: {} targets for {n} rows", targets.len());
    let largest = targets.iter().max().map_or(0, |&target| target as usize);
    assert!(largest < n_vocab, "cross_entropy: target {largest} in a vocabulary of {n_vocab}");
}
