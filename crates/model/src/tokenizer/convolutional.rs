//! The convolutional motion autoencoder of T2M-GPT, which ScaMo keeps: two halves of residual
//! blocks without normalisation, with a quantizer between them.
//!
//! Shapes: b clips, t frames, c channels, f features; t/s latents where s = 2^down.

use burn::module::Module;
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::halves::{Decode, Encode, Pass};
use crate::learn::layers::Conv1d;
use crate::spec::ConvolutionalSpec;

/// A block's dilation over the next one's: 9, 3, 1.
const DILATION_GROWTH: usize = 3;

/// Blocks with the largest dilation first, in both halves.
fn blocks(sizes: &ConvolutionalSpec, rng: &mut ChaCha8Rng, device: &Device) -> Vec<ResidualBlock> {
    let dilation = |i: usize| DILATION_GROWTH.pow(i as u32);
    let blocks = (0..sizes.depth).rev();
    blocks.map(|i| ResidualBlock::new(sizes.width, dilation(i), rng, device)).collect()
}

/// x + conv₁(relu(conv₃(relu(x)))), with the dilation in the first convolution.
#[derive(Module, Debug)]
struct ResidualBlock {
    dilated: Conv1d,
    point: Conv1d,
}

impl ResidualBlock {
    fn new(width: usize, dilation: usize, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        Self {
            dilated: Conv1d::same([width, width], dilation, rng, device).rectified(),
            point: Conv1d::point([width, width], rng, device).rectified(),
        }
    }

    fn forward(&self, x_btc: Tensor<3>) -> Tensor<3> {
        x_btc.clone() + self.point.forward(self.dilated.forward(x_btc))
    }
}

/// A halving, then blocks.
#[derive(Module, Debug)]
struct DownStage {
    halving: Conv1d,
    blocks: Vec<ResidualBlock>,
}

impl DownStage {
    fn new(sizes: &ConvolutionalSpec, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        Self {
            halving: Conv1d::halving([sizes.width; 2], rng, device),
            blocks: blocks(sizes, rng, device),
        }
    }

    fn forward(&self, x_btc: Tensor<3>) -> Tensor<3> {
        self.blocks.iter().fold(self.halving.forward(x_btc), |x, block| block.forward(x))
    }
}

/// Blocks, then nearest upsampling and a convolution.
#[derive(Module, Debug)]
struct UpStage {
    blocks: Vec<ResidualBlock>,
    smoothing: Conv1d,
}

impl UpStage {
    fn new(sizes: &ConvolutionalSpec, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        Self {
            blocks: blocks(sizes, rng, device),
            smoothing: Conv1d::doubling([sizes.width; 2], rng, device),
        }
    }

    fn forward(&self, x_btc: Tensor<3>) -> Tensor<3> {
        let x_btc = self.blocks.iter().fold(x_btc, |x, block| block.forward(x));
        self.smoothing.forward(x_btc)
    }
}

/// Normalised features to latents.
#[derive(Module, Debug)]
pub struct Encoder {
    input: Conv1d,
    stages: Vec<DownStage>,
    output: Conv1d,
}

impl Encoder {
    /// Fresh weights; latents have as many channels as hidden layers.
    pub fn new(
        sizes: &ConvolutionalSpec,
        n_features: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let w = sizes.width;
        Self {
            input: Conv1d::same([n_features, w], 1, rng, device),
            stages: (0..sizes.down).map(|_| DownStage::new(sizes, rng, device)).collect(),
            output: Conv1d::same([w, w], 1, rng, device),
        }
    }
}

impl Encode for Encoder {
    fn forward(&self, x_btf: Tensor<3>, _: &mut Pass) -> Tensor<3> {
        let x_btc = relu(self.input.forward(x_btf));
        self.output.forward(self.stages.iter().fold(x_btc, |x, stage| stage.forward(x)))
    }
}

/// Latents to normalised features.
#[derive(Module, Debug)]
pub struct Decoder {
    input: Conv1d,
    stages: Vec<UpStage>,
    hidden: Conv1d,
    output: Conv1d,
}

impl Decoder {
    /// Fresh weights.
    pub fn new(
        sizes: &ConvolutionalSpec,
        n_features: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let w = sizes.width;
        Self {
            input: Conv1d::same([w, w], 1, rng, device),
            stages: (0..sizes.down).map(|_| UpStage::new(sizes, rng, device)).collect(),
            hidden: Conv1d::same([w, w], 1, rng, device),
            output: Conv1d::same([w, n_features], 1, rng, device).rectified(),
        }
    }
}

impl Decode for Decoder {
    fn forward(&self, latents_btc: Tensor<3>, _: usize, _: &mut Pass) -> Tensor<3> {
        let x_btc = relu(self.input.forward(latents_btc));
        let x_btc = self.stages.iter().fold(x_btc, |x, stage| stage.forward(x));
        self.output.forward(self.hidden.forward(x_btc))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::rand_core::SeedableRng;

    /// T2M-GPT's shape at another width.
    fn sizes(width: usize) -> ConvolutionalSpec {
        ConvolutionalSpec { width, depth: 3, down: 2 }
    }

    #[test]
    fn at_width_512_the_halves_have_the_published_parameters() {
        let (device, mut rng) = (Device::flex(), ChaCha8Rng::seed_from_u64(0));
        let sizes = sizes(512);
        assert_eq!(Encoder::new(&sizes, 263, &mut rng, &device).num_params(), 9_587_200);
        assert_eq!(Decoder::new(&sizes, 263, &mut rng, &device).num_params(), 9_849_607);
    }

    #[test]
    fn four_frames_become_one_latent_and_come_back() {
        let (device, mut rng) = (Device::flex(), ChaCha8Rng::seed_from_u64(0));
        let encoder = Encoder::new(&sizes(8), 11, &mut rng, &device);
        let latents = encoder.forward(Tensor::ones([2, 20, 11], &device), &mut Pass::default());
        assert_eq!(latents.dims(), [2, 5, 8]);
        let decoder = Decoder::new(&sizes(8), 11, &mut rng, &device);
        assert_eq!(decoder.forward(latents, 20, &mut Pass::default()).dims(), [2, 20, 11]);
    }

    #[test]
    fn the_first_block_of_a_stage_has_the_largest_dilation() {
        let (device, mut rng) = (Device::flex(), ChaCha8Rng::seed_from_u64(0));
        let reach = |block: &ResidualBlock| {
            let still = Tensor::<3>::zeros([1, 41, 8], &device);
            let mut impulse = vec![0.0f32; 41 * 8];
            impulse[20 * 8..21 * 8].fill(1.0);
            let data = burn::tensor::TensorData::new(impulse, [1, 41, 8]);
            let moved = block.forward(Tensor::from_data(data, &device));
            let change = (moved - block.forward(still)).abs().sum_dim(2).into_data();
            let change = change.try_into_vec::<f32>().unwrap();
            (21..41).filter(|&t| change[t] > 0.0).map(|t| t - 20).max().unwrap()
        };
        let blocks = blocks(&sizes(8), &mut rng, &device);
        assert_eq!(blocks.iter().map(reach).collect::<Vec<_>>(), [9, 3, 1]);
    }
}
