//! [`Block`]: a residual block at the rate of latents.
//!
//! Shapes: b clips, t latents, c channels.

use burn::module::{Module, Param};
use burn::tensor::activation::gelu;
use burn::tensor::module::layer_norm;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use crate::learn::layers::Conv1d;
use crate::learn::params;

const EPSILON: f64 = 1e-5;
/// Share of its usual size at which the second convolution begins, so that blocks begin small.
const SMALL: f32 = 0.3;

/// x + conv₁(gelu(conv₃(norm(x)))), with the dilation in the first convolution.
#[derive(Module, Debug)]
pub struct Block {
    /// `[c]`.
    gain: Param<Tensor<1>>,
    /// `[c]`.
    bias: Param<Tensor<1>>,
    dilated: Conv1d,
    point: Conv1d,
}

impl Block {
    /// A block that reads latents up to `dilation` away.
    pub fn new(width: usize, dilation: usize, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        Self {
            gain: params::constant([width], 1.0, device),
            bias: params::constant([width], 0.0, device),
            dilated: Conv1d::same([width; 2], dilation, rng, device),
            point: Conv1d::point([width; 2], rng, device).scaled(SMALL),
        }
    }

    /// `[b, t, c]` to the same.
    pub fn forward(&self, x_btc: Tensor<3>) -> Tensor<3> {
        let normed = layer_norm(x_btc.clone(), self.gain.val(), Some(self.bias.val()), EPSILON);
        x_btc + self.point.forward(gelu(self.dilated.forward(normed)))
    }
}
