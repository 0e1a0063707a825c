//! [`Kernels`]: the operations, each by the implementation that is asked for.

use std::sync::Arc;

use burn::backend::Dispatch;
use burn::tensor::{Device, FloatDType, Tensor};

use super::own::{self, FeedForward, HeadLoss, OwnUpdates, SelectRows};
use super::parts::sums_of_parts;
use super::{
    Activation, AttentionOptions, AttentionWeights, Convolution, FeedForwardWeights, HeadWeights,
    plain, shapes,
};

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

impl Kernels {
    /// The faster implementation that runs on `device`, with or without autodiff.
    pub fn for_device(device: &Device) -> Self {
        if *device == Device::flex() { Kernels::Own } else { Kernels::Plain }
    }

    /// What burn's products of matrices are computed by.
    pub(super) fn product(self) -> plain::Product {
        match self {
            Kernels::Half(half) => plain::Product::In(half.dtype()),
            Kernels::Own | Kernels::Plain => plain::Product::Single,
        }
    }

    /// The attention half of a block: multi-head attention with rotary positions and a
    /// bidirectional text prefix (ScaMo §3.2), y = x + Attention(RMSNorm(x) W_qkv) W_output.
    ///
    /// The columns of W_qkv are `[q | k | v]`, each d = n_head · head_dim wide, head after head.
    /// In each head of each sequence, with q̂ and k̂ turned by [`Rope`](super::Rope),
    ///
    /// W = softmax(q̂ k̂ᵀ / √head_dim) over the positions that the
    /// [`SequenceLayout`](super::SequenceLayout) lets each row see, a = W v;
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
        shapes::attention(x_nd.dims(), weights.qkv_d3d.dims(), options);
        match self {
            Kernels::Plain | Kernels::Half(_) => {
                plain::attention_half(x_nd, weights, options, self.product())
            }
            Kernels::Own => {
                let AttentionWeights { gamma_d, qkv_d3d, output_dd } = weights;
                own::of_four(options.clone(), x_nd, gamma_d, qkv_d3d, output_dd)
            }
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
        shapes::feed_forward(x_nd.dims(), weights.up_du.dims(), weights.down_fd.dims(), activation);
        match self {
            Kernels::Plain | Kernels::Half(_) => {
                plain::feed_forward_half(x_nd, weights, activation, epsilon, self.product())
            }
            Kernels::Own => {
                let FeedForwardWeights { gamma_d, up_du, down_fd } = weights;
                own::of_four(FeedForward { activation, epsilon }, x_nd, gamma_d, up_du, down_fd)
            }
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
        shapes::targets([x_sd.dims()[0], weights.weight_dv.dims()[1]], targets);
        match self {
            Kernels::Plain | Kernels::Half(_) => {
                let logits_sv = plain::logits(x_sd, weights, epsilon, self.product());
                plain::cross_entropy(logits_sv, targets)
            }
            Kernels::Own => {
                let head = HeadLoss { targets: targets.clone(), epsilon };
                own::of_three(head, x_sd, weights.gamma_d, weights.weight_dv)
            }
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
        shapes::targets([x_sd.dims()[0], weights.weight_dv.dims()[1]], targets);
        match self {
            Kernels::Plain | Kernels::Half(_) => {
                plain::nll(plain::logits(x_sd, weights, epsilon, self.product()), targets)
            }
            Kernels::Own => sums_of_parts(Tensor::<2>::from_dispatch(Dispatch::own_head_nll(
                HeadLoss { targets: targets.clone(), epsilon },
                x_sd.without_autodiff().into_dispatch(),
                weights.gamma_d.without_autodiff().into_dispatch(),
                weights.weight_dv.without_autodiff().into_dispatch(),
            ))),
        }
    }

    /// A convolution over the frames of clips, with ρ the identity or max(·, 0) as asked for:
    /// yᵢ = b + Σ over taps j of ρ(x_s(i, j)) W_j, where [`Taps`](super::Taps) says
    /// which row s(i, j) is, and rows beyond the clip are zero. W is `[k c, o]`, the earliest tap
    /// first.
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
        shapes::convolution(x_nc.dims(), weight.dims(), bias_o.dims(), convolution);
        match self {
            Kernels::Plain | Kernels::Half(_) => {
                plain::convolve(x_nc, weight, bias_o, convolution, self.product())
            }
            Kernels::Own => own::of_three(convolution, x_nc, weight, bias_o),
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
            Kernels::Own => own::of_one(SelectRows(rows.clone()), x_md),
        }
    }
}
