//! [`Block`]: the parameters of a layer.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use crate::learn::params::{constant, normal};
use crate::ops::{AttentionWeights, FeedForwardWeights};
use crate::spec::{Ffn, ModelShape};

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

    /// Those of its attention.
    pub fn attention(&self) -> AttentionWeights {
        AttentionWeights {
            gamma_d: self.norm_attention.val(),
            qkv_d3d: self.qkv.val(),
            output_dd: self.output.val(),
        }
    }

    /// Those of its feed-forward half.
    pub fn feed_forward(&self) -> FeedForwardWeights {
        FeedForwardWeights {
            gamma_d: self.norm_ffn.val(),
            up_du: self.up.val(),
            down_fd: self.down.val(),
        }
    }
}
