//! [`Backbone`]: the blocks of a model over whole sequences.
//!
//! Shapes: n rows of the batch, d width.

use std::sync::Arc;

use burn::module::Param;
use burn::tensor::{Device, Tensor, TensorData};

use super::block::Block;
use crate::ops::{Activation, AttentionOptions, HalfFloat, Kernels, Rope, SequenceLayout};
use crate::spec::{Ffn, ModelShape, Precision};

/// RMSNorm's ε, as in LLaMA.
pub const EPSILON: f32 = 1e-5;

/// What the forward pass of a model needs beside its parameters.
#[derive(Clone, Debug)]
pub struct Backbone {
    pub shape: ModelShape,
    pub rope: Arc<Rope>,
    pub kernels: Kernels,
    pub device: Device,
}

impl Backbone {
    /// That of a model whose positions follow one another.
    pub fn new(shape: &ModelShape, kernels: Kernels, device: &Device) -> Self {
        let rope = Rope::new(shape.n_ctx, shape.d_model / shape.n_head, shape.rope_base);
        Self { shape: shape.clone(), rope: Arc::new(rope), kernels, device: device.clone() }
    }

    /// The same without gradients and in single precision, for evaluation.
    pub fn frozen(&self) -> Self {
        let kernels = match self.kernels {
            Kernels::Half(_) => Kernels::for_device(&self.device),
            single => single,
        };
        Self { kernels, device: self.device.clone().inner(), ..self.clone() }
    }

    /// What blocks make of rows of packed sequences, `[n, d]`.
    pub fn forward(
        &self,
        blocks: &[Block],
        x_nd: Tensor<2>,
        layout: &Arc<SequenceLayout>,
    ) -> Tensor<2> {
        let (layout, rope) = (layout.clone(), self.rope.clone());
        let options =
            AttentionOptions { n_head: self.shape.n_head, layout, rope, epsilon: EPSILON };
        blocks.iter().fold(x_nd, |x_nd, block| {
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

    /// x W + b of row-major vectors, each as long as the weight has rows, `[n, d]`.
    pub fn projected(
        &self,
        values: Vec<f32>,
        weight: &Param<Tensor<2>>,
        bias: &Param<Tensor<1>>,
    ) -> Tensor<2> {
        let [channels, _] = weight.dims();
        let rows = values.len() / channels;
        let x = Tensor::<2>::from_data(TensorData::new(values, [rows, channels]), &self.device);
        x.matmul(weight.val()) + bias.val().unsqueeze::<2>()
    }

    /// Rows of a parameter, in the order given, `[n, d]`.
    pub fn looked_up(&self, table: &Param<Tensor<2>>, rows: &Arc<[u32]>) -> Tensor<2> {
        self.kernels.select_rows(table.val(), rows)
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
