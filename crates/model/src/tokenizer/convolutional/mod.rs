//! The convolutional architecture: T2M-GPT's autoencoder, and its convolutions.

mod autoencoder;

pub use autoencoder::{Decoder, Encoder};
