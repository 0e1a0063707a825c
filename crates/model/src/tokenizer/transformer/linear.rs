//! [`Linear`]: a layer whose rows have the same bits whatever rows are beside them.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use crate::learn::params::{constant, normal};
use crate::ops::{Convolution, Kernels, Taps};

/// x W + b.
#[derive(Module, Debug)]
pub struct Linear {
    /// `[c_in, c_out]`.
    weight: Param<Tensor<2>>,
    /// `[c_out]`.
    bias: Param<Tensor<1>>,
}

impl Linear {
    /// Weights N(0, std²) and no bias, as LG-Tok begins.
    pub fn new(channels: [usize; 2], std: f64, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        let bias = constant([channels[1]], 0.0, device);
        Self { weight: normal(channels, std, rng, device), bias }
    }

    /// Where the weights are.
    pub fn device(&self) -> Device {
        self.weight.device()
    }

    /// `[n, c_in]` to `[n, c_out]`.
    pub fn forward(&self, x_nc: Tensor<2>) -> Tensor<2> {
        let alone = Convolution { n_clips: 1, taps: Taps::Point, rectify: false };
        let kernels = Kernels::for_device(&x_nc.device());
        kernels.convolve(x_nc, self.weight.val(), self.bias.val(), alone)
    }
}
