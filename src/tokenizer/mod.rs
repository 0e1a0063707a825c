//! Motion tokenizers: a convolutional autoencoder with a quantizer between its halves.
//!
//! [`train()`] turns a [`TokenizerSpec`](crate::spec::TokenizerSpec) and clips into a [`Tokenizer`]; [`tokenize`] turns clips
//! into the file behind a [`TokenStore`](crate::codes::TokenStore); [`evaluate()`] measures both on the test split.

mod architecture;
mod batches;
mod codec;
mod convolutional;
mod encode;
mod error;
mod evaluate;
mod loss;
mod metrics;
mod module;
mod normalise;
mod pool;
mod quantizer;
#[cfg(test)]
mod testing;
mod train;

pub use architecture::{Architecture, Decode, Encode};
pub use codec::Tokenizer;
pub use convolutional::{AutoencoderConfig, Decoder, Encoder};
pub use encode::{tokenize, tokenize_split};
pub use error::TokenizerError;
pub use evaluate::evaluate;
pub use metrics::TokenizerMetrics;
pub use quantizer::{AnyQuantizer, Fsq, Quantized, Quantizer, Vq};
pub use train::train;
