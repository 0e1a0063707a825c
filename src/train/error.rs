//! [`TrainError`]: why a run ends without a result.

use super::weights::WeightsError;

/// Why a run ended without a result.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// The loss is not a number any more.
    #[error("the loss is {loss} at step {step} of {steps}: lower train.lr")]
    NonFinite { step: usize, steps: usize, loss: f64 },
    /// The loss is far above that of a model that knows nothing.
    #[error(
        "diverged: the loss is {loss:.2} nats at step {step} of {steps}, {uniform:.2} would be \
         knowing nothing: lower train.lr"
    )]
    Diverged { step: usize, steps: usize, loss: f64, uniform: f64 },
    /// The caller asked for a stop; a checkpoint was written.
    #[error("stopped at step {step} of {steps}; its checkpoint is written")]
    Stopped { step: usize, steps: usize },
    /// Tokens and spec do not belong together.
    #[error("the tokens have {found} codes, the run wants {wanted}")]
    Vocabulary { found: usize, wanted: usize },
    /// A clip is longer than the model's context.
    #[error(
        "clip {clip} of the {split} split takes {positions} positions with its text, the model \
         has {n_ctx}: raise model.motion_slots by {}",
        positions - n_ctx
    )]
    Context { split: &'static str, clip: usize, positions: usize, n_ctx: usize },
    /// The device does not compute in the run's precision.
    #[error("the device does not compute in {0}: set train.precision to {other}", other = others(.0))]
    Precision(&'static str),
    /// The checkpoint.
    #[error(transparent)]
    Weights(#[from] WeightsError),
}

/// What to try in place of a precision.
fn others(precision: &str) -> &'static str {
    if precision == "f16" { "bf16 or f32" } else { "f16 or f32" }
}
