//! Motion tokenizers: an autoencoder with a quantizer between its halves.
//!
//! [`train()`] turns a [`TokenizerSpec`](crate::spec::TokenizerSpec) and clips into a [`Tokenizer`]; [`tokenize`] turns clips
//! into the file behind a [`TokenStore`](crate::codes::TokenStore); [`evaluate()`] measures both on the test split.
//!
//! # Example
//!
//! ```
//! use burn::tensor::Device;
//! use isoflop_motion::data::{self, MotionSource, Split};
//! use isoflop_spec::progress::{Progress, Stop};
//! use isoflop_spec::spec::{TokenizerSpec, TokenizerTraining};
//! use isoflop_spec::spec::{Clips, DataSection};
//! use isoflop_model::tokenizer::{Corpus, train};
//!
//! let section = DataSection { clips: Clips::Count(8), ..DataSection::default() };
//! let source = data::open(&section, None)?;
//! let training = TokenizerTraining { steps: 2, batch: 2, ..TokenizerTraining::default() };
//! let spec = TokenizerSpec { training, ..TokenizerSpec::default() };
//! let mut no_progress = |_| std::ops::ControlFlow::Continue(());
//! let tokenizer = train(&spec, &Corpus::wordless(&*source), &Device::flex(), None, &mut no_progress)?;
//! let codes = tokenizer.encode(&source.features(Split::Test, 0)?, None)?;
//! assert!(codes.iter().all(|code| (*code as usize) < tokenizer.n_vocab()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod architecture;
mod average;
mod axes;
mod baseline;
mod batches;
mod begin;
mod captions;
mod code_map;
mod codec;
mod convolutional;
mod corpus;
mod encode;
mod error;
mod evaluate;
mod handover;
mod loss;
mod metrics;
mod mix;
mod module;
mod normalise;
mod parts;
mod pass;
mod patch;
mod pool;
mod quantizer;
mod report;
#[cfg(test)]
mod testing;
mod train;
mod transformer;
mod watch;
mod windows;

pub use architecture::{AnyDecoder, AnyEncoder, Decode, Encode};
pub use baseline::k_means_baseline;
pub use captions::Captions;
pub use code_map::{CodeMap, ScaleCodes};
pub use codec::Tokenizer;
pub use corpus::Corpus;
pub use encode::tokenize;
pub use error::TokenizerError;
pub use evaluate::{Reconstruction, evaluate, reconstruct};
pub use handover::{Handover, HandoverFiles, taken_back};
pub use metrics::{Baseline, ScaleUse, TokenizerMetrics};
pub use parts::{Parts, share_kept};
pub use pass::Pass;
pub use quantizer::{
    AnyQuantizer, Extent, Fsq, Multiscale, Quantized, Quantizer, ResidualFsq, ResidualVq, Vq,
    area_down, linear_up,
};
pub use report::{remarks, table};
pub use train::{train, train_watched};
pub use watch::{Validated, best};
