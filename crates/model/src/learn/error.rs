//! [`LearnError`]: why learning ends without a result.

use crate::failure::FailureKind;
use crate::files::FileError;

/// Why learning ended without a result.
#[derive(Debug, thiserror::Error)]
pub enum LearnError {
    /// The loss is not a number any more.
    #[error("the loss is {loss} at step {step} of {steps}: {advice}")]
    NonFinite { step: usize, steps: usize, loss: f64, advice: &'static str },
    /// The loss is far above that of knowing nothing.
    #[error(
        "diverged: the loss is {loss:.2} at step {step} of {steps}, {ignorant:.2} would be knowing \
         nothing: {advice}"
    )]
    Diverged { step: usize, steps: usize, loss: f64, ignorant: f64, advice: &'static str },
    /// The caller asked for a stop; a checkpoint was written.
    #[error("stopped at step {step} of {steps}; its checkpoint is written")]
    Stopped { step: usize, steps: usize },
    /// A checkpoint could not be written or read.
    #[error(transparent)]
    File(#[from] FileError),
}

impl LearnError {
    /// The failure of a job that ends with it; `None` for a stop, which is no failure.
    pub fn failure_kind(&self) -> Option<FailureKind> {
        match self {
            Self::NonFinite { .. } | Self::Diverged { .. } => Some(FailureKind::Diverged),
            Self::File(error) => Some(error.failure_kind()),
            Self::Stopped { .. } => None,
        }
    }
}
