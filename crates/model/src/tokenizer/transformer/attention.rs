//! [`SelfAttention`] of packed rows, and [`CrossAttention`] from frames to what is known of them.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::linear::Linear;
use crate::ops::{AttentionOptions, CrossOptions, Kernels};

/// Multi-head attention with rotary positions, with biases: Attention(x W_qkv + b) W_o + b.
#[derive(Module, Debug)]
pub struct SelfAttention {
    /// `[d, 3d]`: queries, keys, values.
    qkv: Linear,
    output: Linear,
}

impl SelfAttention {
    /// Weights of deviation `std`.
    pub fn new(width: usize, std: f64, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        Self {
            qkv: Linear::new([width, 3 * width], std, rng, device),
            output: Linear::new([width, width], std, rng, device),
        }
    }

    /// `[n, d]` to the same.
    pub fn forward(&self, x_nd: Tensor<2>, options: &AttentionOptions) -> Tensor<2> {
        let qkv_n3d = self.qkv.forward(x_nd);
        let kernels = Kernels::for_device(&qkv_n3d.device());
        self.output.forward(kernels.attend(qkv_n3d, options))
    }
}

/// Rows that frames attend to, those of each clip together.
#[derive(Clone, Debug)]
pub struct Memory {
    /// `[m, d]`.
    pub rows_md: Tensor<2>,
    /// Which frames attend to which rows.
    pub options: CrossOptions,
}

/// Multi-head attention from frames to a memory, without causality.
#[derive(Module, Debug)]
pub struct CrossAttention {
    query: Linear,
    /// `[d, 2d]`: keys, values.
    key_value: Linear,
    output: Linear,
}

impl CrossAttention {
    /// Weights of deviation `std`.
    pub fn new(width: usize, std: f64, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        Self {
            query: Linear::new([width, width], std, rng, device),
            key_value: Linear::new([width, 2 * width], std, rng, device),
            output: Linear::new([width, width], std, rng, device),
        }
    }

    /// `[b·f, d]` to the same.
    pub fn forward(&self, x_nd: Tensor<2>, memory: &Memory) -> Tensor<2> {
        let kernels = Kernels::for_device(&x_nd.device());
        let key_values = self.key_value.forward(memory.rows_md.clone());
        let queries_nd = self.query.forward(x_nd);
        self.output.forward(kernels.cross_attend(queries_nd, key_values, &memory.options))
    }
}
