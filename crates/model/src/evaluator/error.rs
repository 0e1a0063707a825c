//! [`EvaluatorError`]: why there is no evaluator, or no embedding.

use crate::data::DataError;
use crate::failure::FailureKind;
use crate::files::FileError;
use crate::learn::LearnError;
use crate::learn::weights::WeightsError;
use crate::scores::ScoreError;

/// Why an evaluator could not be trained, judged, saved, loaded or used.
#[derive(Debug, thiserror::Error)]
pub enum EvaluatorError {
    /// A split of too few clips.
    #[error("an evaluator needs {least} clips of the {split} split, there are {found}")]
    TooFewClips { split: &'static str, least: usize, found: usize },
    /// A motion that is shorter than what is seen as one.
    #[error("a motion of {n_frames} frames is too short: the evaluator sees {least} as one")]
    TooShort { n_frames: usize, least: usize },
    /// A motion of other features.
    #[error("a motion of {values} values is not made of frames of {wanted} features")]
    Features { values: usize, wanted: usize },
    /// Embeddings that have no score.
    #[error(transparent)]
    Score(#[from] ScoreError),
    /// Learning ended before its end.
    #[error(transparent)]
    Learn(#[from] LearnError),
    /// The data set.
    #[error(transparent)]
    Data(#[from] DataError),
    /// Weights of another evaluator, or their file.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
}

impl EvaluatorError {
    /// The failure of a job that ends with it; `None` for a stop, which is no failure.
    pub fn failure_kind(&self) -> Option<FailureKind> {
        match self {
            Self::Learn(error) => error.failure_kind(),
            Self::Data(error) => Some(error.failure_kind()),
            Self::File(error) | Self::Weights(WeightsError::File(error)) => {
                Some(error.failure_kind())
            }
            Self::Weights(WeightsError::Mismatch { .. }) => Some(FailureKind::Damaged),
            _ => Some(FailureKind::BadData),
        }
    }

    /// Why learning ended, if that is the reason.
    pub fn learn_error(&self) -> Option<&LearnError> {
        if let Self::Learn(error) = self { Some(error) } else { None }
    }
}
