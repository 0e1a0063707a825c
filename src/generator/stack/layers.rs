//! [`Stack`]: the blocks of a model over whole sequences.
//!
//! Shapes: n rows of the batch, d width.

use std::sync::Arc;

use burn::tensor::{Device, Tensor};

use super::block::Block;
use crate::ops::{Activation, AttentionOptions, HalfFloat, Kernels, Rope, SequenceLayout};
use crate::spec::{Ffn, ModelShape, Precision};

/// RMSNorm's ε, as in LLaMA.
pub const EPSILON: f32 = 1e-5;

/// The blocks of a model, and what their forward pass needs beside their parameters.
#[derive(Clone, Copy)]
pub struct Stack<'a> {
    pub blocks: &'a [Block],
    pub shape: &'a ModelShape,
    pub rope: &'a Arc<Rope>,
    pub kernels: Kernels,
    pub device: &'a Device,
}

impl Stack<'_> {
    /// What the blocks make of rows of packed sequences, `[n, d]`.
    pub fn forward(&self, x_nd: Tensor<2>, layout: &Arc<SequenceLayout>) -> Tensor<2> {
        let (layout, rope) = (layout.clone(), self.rope.clone());
        let options =
            AttentionOptions { n_head: self.shape.n_head, layout, rope, epsilon: EPSILON };
        self.blocks.iter().fold(x_nd, |x_nd, block| {
            let x_nd = self.kernels.attention(x_nd, block.attention(), &options);
            self.feed_forward(block, x_nd)
        })
    }

    /// The feed-forward half of a block, `[n, d]`.
    pub fn feed_forward(&self, block: &Block, x_nd: Tensor<2>) -> Tensor<2> {
        let activation = match self.shape.ffn {
            Ffn::SwiGlu => Activation::SwiGlu,
            Ffn::Gelu => Activation::Gelu,
        };
        self.kernels.feed_forward(x_nd, block.feed_forward(), activation, EPSILON)
    }
}

/// The kernels of a precision.
pub fn kernels_of(precision: Precision, device: &Device) -> Kernels {
    match precision {
        Precision::F32 => Kernels::for_device(device),
        Precision::F16 => Kernels::Half(HalfFloat::F16),
        Precision::Bf16 => Kernels::Half(HalfFloat::Bf16),
    }
}

/// The kernels that a model is measured with: in single precision.
pub fn single(kernels: Kernels, device: &Device) -> Kernels {
    match kernels {
        Kernels::Half(_) => Kernels::for_device(device),
        single => single,
    }
}
