//! The convolutional motion autoencoder of T2M-GPT, which ScaMo keeps: two halves of residual
//! blocks without normalisation, with a quantizer between them.
//!
//! Shapes: b clips, t frames, c channels, f features; t/s latents where s = 2^down.

use burn::module::Module;
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use crate::learn::layers::Conv1d;
use crate::spec::ConvolutionalSpec;
use crate::tokenizer::architecture::{AnyDecoder, AnyEncoder, Architecture, Decode, Encode};
use crate::tokenizer::pass::Pass;

/// The shape of both halves.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AutoencoderConfig {
    /// Features of a frame.
    pub n_features: usize,
    /// Channels of every hidden layer; 512 in T2M-GPT and ScaMo.
    pub width: usize,
    /// Residual blocks at each resolution; 3 there.
    pub depth: usize,
    /// Halvings of the frame rate; 2 there, so 4 frames a token.
    pub down: usize,
    /// A block's dilation over the next one's; 3 there, so 9, 3, 1.
    pub dilation_growth: usize,
    /// Channels of a latent; `width` there.
    pub code_dim: usize,
}

impl AutoencoderConfig {
    /// T2M-GPT's shape at another width.
    pub fn new(n_features: usize, width: usize) -> Self {
        Self { n_features, width, depth: 3, down: 2, dilation_growth: 3, code_dim: width }
    }

    /// The shape of given sizes.
    pub fn of(sizes: &ConvolutionalSpec, n_features: usize) -> Self {
        Self { depth: sizes.depth, down: sizes.down, ..Self::new(n_features, sizes.width) }
    }

    /// The half that turns features into latents.
    pub fn init_encoder(&self, rng: &mut ChaCha8Rng, device: &Device) -> Encoder {
        let w = self.width;
        Encoder {
            input: Conv1d::same([self.n_features, w], 1, rng, device),
            stages: (0..self.down).map(|_| DownStage::new(self, rng, device)).collect(),
            output: Conv1d::same([w, self.code_dim], 1, rng, device),
        }
    }

    /// The half that turns latents into features.
    pub fn init_decoder(&self, rng: &mut ChaCha8Rng, device: &Device) -> Decoder {
        let w = self.width;
        Decoder {
            input: Conv1d::same([self.code_dim, w], 1, rng, device),
            stages: (0..self.down).map(|_| UpStage::new(self, rng, device)).collect(),
            hidden: Conv1d::same([w, w], 1, rng, device),
            output: Conv1d::same([w, self.n_features], 1, rng, device).rectified(),
        }
    }

    /// Blocks with the largest dilation first, in both halves.
    fn init_blocks(&self, rng: &mut ChaCha8Rng, device: &Device) -> Vec<ResidualBlock> {
        let dilation = |i: usize| self.dilation_growth.pow(i as u32);
        let blocks = (0..self.depth).rev();
        blocks.map(|i| ResidualBlock::new(self.width, dilation(i), rng, device)).collect()
    }
}

impl Architecture for AutoencoderConfig {
    fn code_dim(&self) -> usize {
        self.code_dim
    }

    fn encoder(&self, rng: &mut ChaCha8Rng, device: &Device) -> AnyEncoder {
        AnyEncoder::Convolutional(self.init_encoder(rng, device))
    }

    fn decoder(&self, rng: &mut ChaCha8Rng, device: &Device) -> AnyDecoder {
        AnyDecoder::Convolutional(self.init_decoder(rng, device))
    }
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
    fn new(config: &AutoencoderConfig, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        Self {
            halving: Conv1d::halving([config.width; 2], rng, device),
            blocks: config.init_blocks(rng, device),
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
    fn new(config: &AutoencoderConfig, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        Self {
            blocks: config.init_blocks(rng, device),
            smoothing: Conv1d::doubling([config.width; 2], rng, device),
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

impl Decode for Decoder {
    fn forward(&self, latents_btc: Tensor<3>, _: &mut Pass) -> Tensor<3> {
        let x_btc = relu(self.input.forward(latents_btc));
        let x_btc = self.stages.iter().fold(x_btc, |x, stage| stage.forward(x));
        self.output.forward(self.hidden.forward(x_btc))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::rand_core::SeedableRng;

    #[test]
    fn at_width_512_the_halves_have_the_published_parameters() {
        let (device, mut rng) = (Device::flex(), ChaCha8Rng::seed_from_u64(0));
        let config = AutoencoderConfig::new(263, 512);
        assert_eq!(config.init_encoder(&mut rng, &device).num_params(), 9_587_200);
        assert_eq!(config.init_decoder(&mut rng, &device).num_params(), 9_849_607);
    }

    #[test]
    fn four_frames_become_one_latent_and_come_back() {
        let (device, mut rng) = (Device::flex(), ChaCha8Rng::seed_from_u64(0));
        let config = AutoencoderConfig { code_dim: 3, ..AutoencoderConfig::new(11, 8) };
        let encoder = config.init_encoder(&mut rng, &device);
        let latents = encoder.forward(Tensor::ones([2, 20, 11], &device), &mut Pass::default());
        assert_eq!(latents.dims(), [2, 5, 3]);
        let decoder = config.init_decoder(&mut rng, &device);
        assert_eq!(decoder.forward(latents, &mut Pass::default()).dims(), [2, 20, 11]);
    }

    #[test]
    fn the_first_block_of_a_stage_has_the_largest_dilation() {
        let (device, mut rng) = (Device::flex(), ChaCha8Rng::seed_from_u64(0));
        let config = AutoencoderConfig::new(4, 8);
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
        let blocks = config.init_blocks(&mut rng, &device);
        assert_eq!(blocks.iter().map(reach).collect::<Vec<_>>(), [9, 3, 1]);
    }
}
