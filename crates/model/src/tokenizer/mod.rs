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

mod captioned;
mod code_map;
mod codec;
mod convolutional;
mod corpus;
mod encode;
mod evaluate;
mod halves;
mod kept_weights;
mod loss;
mod module;
mod patch;
mod pool;
mod quantizer;
#[cfg(test)]
mod testing;
mod train;
mod transformer;
mod windows;

use crate::data::DataError;
use crate::failure::FailureKind;
use crate::files::FileError;
use crate::learn::weights::WeightsError;
use crate::learn::{Cause, LearnError, TrainingError};
use crate::spec::SpecError;

pub use codec::Tokenizer;
pub use corpus::Corpus;
pub use encode::{Parts, share_kept, tokenize};
pub use evaluate::{Reconstruction, evaluate, k_means_baseline, reconstruct};
pub use halves::{Captions, Decode, Encode, Pass};
pub use kept_weights::{Validated, best};
pub use module::{AnyDecoder, AnyEncoder, AnyQuantizer};
pub use quantizer::{
    Extent, Fsq, Multiscale, Quantized, Quantizer, ResidualFsq, ResidualVq, Vq, area_down,
    linear_up,
};
pub use train::{Handover, HandoverFiles, taken_back, train, train_watched};

/// Why a tokenizer could not be trained, saved, loaded or used.
#[derive(Debug, thiserror::Error)]
pub enum TokenizerError {
    /// A field of the specification has a value that no training can use.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// No clip of the training split is long enough.
    #[error(
        "none of the {n_clips} training clips has {window} frames, the longest has {longest}: \
         set tokenizer.window to {longest} or less"
    )]
    NoWindow { window: usize, n_clips: usize, longest: usize },
    /// A clip is too short to make one token.
    #[error("clip {clip} of the {split} split has {n_frames} frames, a token takes {stride}")]
    ShortClip { clip: String, split: &'static str, n_frames: usize, stride: usize },
    /// An id that no code has, such as the end token's.
    #[error("{id} is no code: a tokenizer of {n_vocab} codes decodes ids from 0 to {n_vocab} - 1")]
    UnknownCode { id: u32, n_vocab: usize },
    /// More or fewer codes than a clip of such a length has.
    #[error("{found} codes are given, clips of {n_frames} frames have {wanted}")]
    CodeCount { found: usize, wanted: usize, n_frames: usize },
    /// A tokenizer with language was given no captions.
    #[error(
        "the tokenizer sees captions (`tokenizer.language`) and was given none: give the vectors of the \
         clip's caption, as the sweep's text encoder makes them"
    )]
    NoText,
    /// Captions of another text encoder.
    #[error(
        "the tokenizer sees words as vectors of {wanted} numbers, the caption has {found}: use the text \
         encoder of the sweep that trained it"
    )]
    TextWidth { found: usize, wanted: usize },
    /// Learning ended before its end.
    #[error(transparent)]
    Learn(#[from] LearnError),
    /// The data set.
    #[error(transparent)]
    Data(#[from] DataError),
    /// Weights of another tokenizer, or their file.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
}

impl TrainingError for TokenizerError {
    fn cause(&self) -> Cause<'_> {
        Cause::Other(match self {
            Self::Learn(error) => return Cause::Learn(error),
            Self::Data(error) => error.failure_kind(),
            Self::File(error) => error.failure_kind(),
            Self::Weights(error) => error.failure_kind(),
            _ => FailureKind::BadData,
        })
    }
}

impl TokenizerError {
    /// The file that is to blame, where it is damaged or gone.
    pub fn damaged_file(&self) -> Option<&FileError> {
        let file = match self {
            Self::File(error)
            | Self::Weights(WeightsError::File(error))
            | Self::Learn(LearnError::File(error)) => Some(error),
            _ => None,
        };
        file.filter(|error| error.is_damage())
    }
}
