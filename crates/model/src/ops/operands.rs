//! What the operations take beside activations.

use std::sync::Arc;

use burn::tensor::Tensor;

use super::{Rope, SequenceLayout};

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
