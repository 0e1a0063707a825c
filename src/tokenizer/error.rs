//! What can go wrong with a tokenizer.

use std::path::Path;

use crate::data::DataError;
use crate::train::weights::WeightsError;

/// Why a tokenizer could not be trained, saved, loaded or used.
#[derive(Debug, thiserror::Error)]
pub enum TokenizerError {
    /// A field of the specification has a value that no training can use.
    #[error("tokenizer.{field}: {problem}")]
    Spec { field: &'static str, problem: String },
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
    /// The loss is not a number any more.
    #[error(
        "the tokenizer's loss is {loss} at step {step}: lower tokenizer.lr, and look for features \
         that are not finite"
    )]
    NonFinite { step: usize, loss: f64 },
    /// The caller asked for an end.
    #[error("tokenizer training was stopped at step {step}")]
    Stopped { step: usize },
    /// The data set.
    #[error(transparent)]
    Data(#[from] DataError),
    /// The weights' file.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// A file could not be written.
    #[error(transparent)]
    Write(#[from] std::io::Error),
    /// A file could not be read.
    #[error("{path}: {reason}")]
    File { path: String, reason: String },
}

impl TokenizerError {
    /// An error of the file at `path`.
    pub(super) fn file(path: &Path, reason: impl ToString) -> Self {
        TokenizerError::File { path: path.display().to_string(), reason: reason.to_string() }
    }
}
