//! [`Smoothing`]: φ, what a scale makes of its codes' embeddings before it adds them.
//!
//! Shapes: b clips, t latents, c channels.

use burn::module::Module;
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use crate::learn::layers::Conv1d;

/// φ(h) = relu(conv₃(relu(conv₃(h)))), as LG-Tok's code has it, so that what a scale adds is never below
/// 0; or with VAR's residual mix m (Tian et al. 2024) φ(h) = (1 − m)·h + m·conv₃(h).
#[derive(Module, Debug)]
pub struct Smoothing {
    convolutions: Vec<Conv1d>,
    #[module(skip)]
    mix: Option<f64>,
}

impl Smoothing {
    /// φ for `code_dim` channels, drawn as PyTorch draws convolutions.
    pub fn new(mix: Option<f64>, code_dim: usize, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        let mut convolution = || Conv1d::same([code_dim; 2], 1, rng, device);
        let convolutions = match mix {
            None => vec![convolution(), convolution().rectified()],
            Some(_) => vec![convolution()],
        };
        Self { convolutions, mix }
    }

    /// `[b, t, c]` to the same.
    pub fn forward(&self, x_btc: Tensor<3>) -> Tensor<3> {
        let y_btc = self.convolutions.iter().fold(x_btc.clone(), |x, conv| conv.forward(x));
        match self.mix {
            None => relu(y_btc),
            Some(mix) => x_btc * (1.0 - mix) + y_btc * mix,
        }
    }
}
