//! Generators: models of codes given text. A folder a kind, each with one [`Generator`].
//!
//! [`of`] is the one place that tells kinds apart.

pub mod autoregressive;
mod error;
mod fitness;
mod kind;
mod learner;
pub mod masked;
mod measurable;
mod passes;
mod probed;
mod sampling;
pub mod scalewise;
mod schedule;
pub(crate) mod stack;
mod sums;
mod trained;

use std::path::Path;

pub use error::GeneratorError;
pub use kind::{Generator, MOST_PROBED_PARAMS, Probe, Training};
pub use sampling::{Choices, Draw, Edit, Prompt, Sampled, Sampler, Sampling, StreamForm};
pub use schedule::learning_rate;
pub use trained::{Inputs, LogLine, ScaleInputs, SplitLoss, Trained};

use crate::plan::RunSpec;
use crate::progress::Progress;
use crate::spec::GeneratorSpec;

/// The generator of a run.
pub fn of(spec: &RunSpec) -> &'static dyn Generator {
    match spec.generator {
        GeneratorSpec::Autoregressive(_) => &autoregressive::AutoregressiveGenerator,
        GeneratorSpec::Masked(_) => &masked::MaskedGenerator,
        GeneratorSpec::Scalewise(_) => &scalewise::ScalewiseGenerator,
    }
}

/// [`Generator::train`] of the generator of a run.
///
/// # Errors
/// As there.
pub fn train(training: &Training, progress: &mut Progress) -> Result<Trained, GeneratorError> {
    of(training.spec).train(training, progress)
}

/// [`Generator::train_trunk`] of the generator of a run.
///
/// # Errors
/// As there.
pub fn train_trunk(
    training: &Training,
    state: &Path,
    progress: &mut Progress,
) -> Result<(), GeneratorError> {
    of(training.spec).train_trunk(training, state, progress)
}
