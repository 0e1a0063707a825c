//! [`Kernels`]: the operations, each by the implementation that is asked for.

use std::sync::Arc;

use burn::tensor::{Device, FloatDType, Tensor};

use super::own::{self, AdamWStep, FeedForward, HeadLoss, RmsNorm, SelectRows, SwiGlu};
use super::{
    Activation, AttentionOptions, AttentionWeights, Convolution, CrossOptions, FeedForwardWeights,
    HeadWeights, RowLosses, plain,
};

/// The implementation of the operations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kernels {
    /// Hand-written kernels, on the device `flex` and in `f32` only. Single-threaded, and the
    /// same input gives the same bits.
    Own,
    /// Burn's operations, on any device.
    Plain,
    /// The same with products of matrices in a half precision, on devices that support it; inputs and outputs are
    /// `f32`.
    Half(HalfFloat),
}

/// A number of sixteen bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HalfFloat {
    F16,
    Bf16,
}

impl HalfFloat {
    /// burn's name of the type.
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

    /// The implementation of burn's products of matrices.
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
    /// In each head of each sequence, with q̂ and k̂ turned by [`Rope`](super::Rope),
    ///
    /// W = softmax(q̂ k̂ᵀ / √head_dim) over the positions that the
    /// [`SequenceLayout`](super::SequenceLayout) makes visible to each row, a = W v;
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
        options.check(x_nd.dims(), weights.qkv_d3d.dims());
        match self {
            Kernels::Own => {
                let AttentionWeights { gamma_d, qkv_d3d, output_dd } = weights;
                own::of_four(options.clone(), x_nd, gamma_d, qkv_d3d, output_dd)
            }
            _ => plain::attention_half(x_nd, weights, options, self.product()),
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
        activation.check(x_nd.dims(), weights.up_du.dims(), weights.down_fd.dims());
        match self {
            Kernels::Own => {
                let FeedForwardWeights { gamma_d, up_du, down_fd } = weights;
                own::of_four(FeedForward { activation, epsilon }, x_nd, gamma_d, up_du, down_fd)
            }
            _ => plain::feed_forward_half(x_nd, weights, activation, epsilon, self.product()),
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
            Kernels::Own => {
                let head = HeadLoss { targets: targets.clone(), epsilon };
                own::of_three(head, x_sd, weights.gamma_d, weights.weight_dv)
            }
            _ => {
                let logits_sv = plain::logits(x_sd, weights, epsilon, self.product());
                plain::cross_entropy(logits_sv, targets)
            }
        }
    }

    /// Cross-entropy and likeliest column of each row, outside autodiff; [`Kernels::Own`] sums in `f64`, and takes the
    /// first of equal columns.
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
    ) -> RowLosses {
        check_targets([x_sd.dims()[0], weights.weight_dv.dims()[1]], targets);
        match self {
            Kernels::Own => {
                own::head_nll(HeadLoss { targets: targets.clone(), epsilon }, x_sd, weights)
            }
            _ => plain::nll(plain::logits(x_sd, weights, epsilon, self.product()), targets),
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
        convolution.check(x_nc.dims(), weight.dims(), bias_o.dims());
        match self {
            Kernels::Own => own::of_three(convolution, x_nc, weight, bias_o),
            _ => plain::convolve(x_nc, weight, bias_o, convolution, self.product()),
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
            Kernels::Own => own::of_one(SelectRows(rows.clone()), x_md),
            _ => plain::select_rows(x_md, rows),
        }
    }

    // The parts of a block, for other blocks: the caller adds biases, norms or residuals.

    /// Attention alone, of the columns `[q | k | v]` of [`Kernels::attention`]: a of its equations, `[n, d]`. The caller adds
    /// norms, biases or residuals.
    ///
    /// # Panics
    ///
    /// As [`Kernels::attention`].
    pub fn attend(self, qkv_n3d: Tensor<2>, options: &AttentionOptions) -> Tensor<2> {
        let [n, columns] = qkv_n3d.dims();
        options.check([n, columns / 3], [columns / 3, columns]);
        match self {
            Kernels::Own => own::of_one(options.clone(), qkv_n3d),
            _ => plain::attend(qkv_n3d, options, self.product()),
        }
    }

    /// Attention from queries to a memory, `[k | v]`: a = softmax(q̂ k̂ᵀ / √head_dim) v, over all rows
    /// of the memory of the query's sequence, with gradients as those of [`Kernels::attention`];
    /// `[n, d]`.
    ///
    /// # Panics
    ///
    /// If the shapes are not those of the layout, heads and angles.
    pub fn cross_attend(
        self,
        queries_nd: Tensor<2>,
        key_values_m2d: Tensor<2>,
        options: &CrossOptions,
    ) -> Tensor<2> {
        options.check(queries_nd.dims(), key_values_m2d.dims());
        match self {
            Kernels::Own => own::of_two(options.clone(), queries_nd, key_values_m2d),
            _ => plain::cross_attend(queries_nd, key_values_m2d, options, self.product()),
        }
    }

    /// RMSNorm alone, x r γ with r = 1 / √(mean(x²) + ε) in each row, `[n, d]`.
    ///
    /// # Panics
    ///
    /// If there is not one γ for each column.
    pub fn rms_norm(self, x_nd: Tensor<2>, gamma_d: Tensor<1>, epsilon: f32) -> Tensor<2> {
        assert_eq!([x_nd.dims()[1]], gamma_d.dims(), "rms_norm: rows and gains of one width");
        match self {
            Kernels::Own => own::of_two(RmsNorm { epsilon }, x_nd, gamma_d),
            _ => plain::rms_norm(x_nd, gamma_d, epsilon),
        }
    }

    /// [`Activation::SwiGlu`] alone, of columns `[gate | up]`, `[n, f]`.
    ///
    /// # Panics
    ///
    /// If the number of columns is odd.
    pub fn swi_glu(self, gate_up_n2f: Tensor<2>) -> Tensor<2> {
        assert!(gate_up_n2f.dims()[1].is_multiple_of(2), "swi_glu: as many gates as values");
        match self {
            Kernels::Own => own::of_one(SwiGlu, gate_up_n2f),
            _ => plain::swiglu(gate_up_n2f),
        }
    }
}

/// Sees that there are rows, and a target within the vocabulary for each.
fn check_targets([n, n_vocab]: [usize; 2], targets: &[u32]) {
    assert!(n > 0, "cross_entropy: no rows to average over");
    assert_eq!(n, targets.len(), "cross_entropy: {} targets for {n} rows", targets.len());
    let largest = targets.iter().max().map_or(0, |&target| target as usize);
    assert!(largest < n_vocab, "cross_entropy: target {largest} in a vocabulary of {n_vocab}");
}

// Operations outside autodiff.

/// The nearest of codes `[v, c]` for each of latents `[n, c]`: argmin over codes of
/// |code|² − 2 latent · code, the first of equals.
///
/// # Panics
///
/// If latents and codes differ in their channels, there is no code, or there are more than 2²⁴.
pub fn nearest(latents_nc: &Tensor<2>, codes_vc: &Tensor<2>) -> Vec<u32> {
    let ([n, c], [v, channels]) = (latents_nc.dims(), codes_vc.dims());
    assert_eq!(c, channels, "nearest: latents of {c} channels, codes of {channels}");
    assert!((1..=MOST_CODES).contains(&v), "nearest: {v} codes");
    if n == 0 {
        return Vec::new();
    }
    match Kernels::for_device(&latents_nc.device()) {
        Kernels::Own => own::nearest(latents_nc, codes_vc),
        _ => plain::nearest(latents_nc, codes_vc),
    }
}

/// As many as `f32` counts without a gap.
const MOST_CODES: usize = 1 << 24;

/// Σ x² over tensors of one device, outside autodiff. A device other than the processor's default is waited
/// for once, not once a tensor.
pub fn sum_of_squares(tensors: Vec<Tensor<1>>) -> f64 {
    let Some(first) = tensors.first() else { return 0.0 };
    if Kernels::for_device(&first.device()) == Kernels::Own {
        return tensors.into_iter().map(own::sum_of_squares).sum();
    }
    let sums: Vec<Tensor<1>> = tensors.into_iter().map(|x| (x.clone() * x).sum()).collect();
    f64::from(Tensor::cat(sums, 0).sum().into_scalar::<f32>())
}

/// A parameter and both its moments after a step of AdamW, all of one length and outside autodiff.
pub fn adamw(
    value: Tensor<1>,
    gradient: Tensor<1>,
    moments: [Tensor<1>; 2],
    step: AdamWStep,
) -> (Tensor<1>, [Tensor<1>; 2]) {
    match Kernels::for_device(&value.device()) {
        Kernels::Own => own::adamw(value, gradient, moments, step),
        _ => plain::adamw(value, gradient, moments, step),
    }
}
