//! Motion tokenizers: a convolutional autoencoder with a quantizer between its halves.
//!
//! [`train`] turns a [`TokenizerSpec`] and clips into a [`Tokenizer`]; [`tokenize`] turns clips
//! into the file behind a [`TokenStore`]; [`evaluate`] measures both on the test split.

mod autoencoder;
mod batches;
mod checkpoint;
mod codec;
mod conv;
mod encode;
mod error;
mod evaluate;
mod fsq;
mod histogram;
mod levels;
mod loss;
mod metrics;
mod module;
mod normalise;
mod pool;
mod quantizer;
mod spec;
mod store;
#[cfg(test)]
mod testing;
mod train;
mod vq;

pub use autoencoder::{AutoencoderConfig, Decoder, Encoder};
pub use checkpoint::Checkpoints;
pub use codec::Tokenizer;
pub use encode::{tokenize, tokenize_split};
pub use error::TokenizerError;
pub use evaluate::evaluate;
pub use fsq::Fsq;
pub use histogram::CodeHistogram;
pub use levels::{levels_for, n_codes, nominal_sizes};
pub use metrics::TokenizerMetrics;
pub use quantizer::{AnyQuantizer, Quantized, Quantizer, QuantizerKind};
pub use spec::TokenizerSpec;
pub use store::{SplitTokens, TokenStore, write_store};
pub use train::train;
pub use vq::{QuantizerState, Vq};
