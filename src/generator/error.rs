//! [`GeneratorError`]: why a run ends without a result.

use crate::failure::FailureKind;
use crate::learn::LearnError;
use crate::learn::weights::WeightsError;

/// Why a run ended without a result.
#[derive(Debug, thiserror::Error)]
pub enum GeneratorError {
    /// Learning ended before its end.
    #[error(transparent)]
    Learn(#[from] LearnError),
    /// Codes and spec do not belong together.
    #[error("the tokens have {found} codes, the run wants {wanted}")]
    Vocabulary { found: usize, wanted: usize },
    /// A clip is longer than the model's context.
    #[error(
        "clip {clip} of the {split} split takes {positions} positions with its text, the model \
         has {n_ctx}: raise model.motion_slots by {}",
        positions - n_ctx
    )]
    Context { split: &'static str, clip: usize, positions: usize, n_ctx: usize },
    /// A motion that was asked for is longer than the model's context.
    #[error(
        "a motion of {n_frames} frames takes {positions} positions with its text, the model has \
         {n_ctx}: ask for at most {most} frames"
    )]
    Length { n_frames: usize, positions: usize, n_ctx: usize, most: usize },
    /// A motion that was asked for is shorter than a code.
    #[error("a motion of {n_frames} frames has no code: ask for at least {least} frames")]
    NoCode { n_frames: usize, least: usize },
    /// Guidance by a model that was trained with every caption.
    #[error(
        "the run was trained with every caption, so that guidance has nothing to move away from: \
         leave guidance at 0, or train with model.text_drop above 0"
    )]
    Guidance,
    /// An edit by a model that sees nothing of what comes later.
    #[error(
        "an autoregressive generator sees no code that comes later, so it cannot fill a part of a \
         motion: edit with a scalewise or a masked one"
    )]
    Edit,
    /// Weights that are not those of the run.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// The device does not compute in the run's precision.
    #[error("the device does not compute in {0}: set train.precision to {other}", other = others(.0))]
    Precision(&'static str),
}

impl GeneratorError {
    /// Why learning ended, if that is the reason.
    pub fn learn_error(&self) -> Option<&LearnError> {
        if let Self::Learn(error) = self { Some(error) } else { None }
    }

    /// The failure of a job that ends with it; `None` for a stop, which is no failure.
    pub fn failure_kind(&self) -> Option<FailureKind> {
        match self {
            Self::Learn(error) => error.failure_kind(),
            Self::Weights(_) => Some(FailureKind::Damaged),
            Self::Precision(_) => Some(FailureKind::Other),
            _ => Some(FailureKind::BadData),
        }
    }
}

/// What to try in place of a precision.
fn others(precision: &str) -> &'static str {
    if precision == "f16" { "bf16 or f32" } else { "f16 or f32" }
}
