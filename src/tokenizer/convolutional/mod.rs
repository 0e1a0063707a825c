//! The convolutional architecture: T2M-GPT's autoencoder, and its convolutions.

mod autoencoder;
mod conv;

pub use autoencoder::{AutoencoderConfig, Decoder, Encoder};
pub use conv::Affine;
