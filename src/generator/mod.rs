//! Generators: models of codes given text. A folder a kind, each with one [`Generator`].
//!
//! [`of`] is the one place that tells kinds apart.

pub mod autoregressive;
mod error;
mod fitness;
mod learner;
mod sampling;
mod schedule;
mod trained;

use std::path::Path;

use burn::tensor::Device;

pub use error::GeneratorError;
pub use sampling::{Choices, Draw, Prompt, Sampled, Sampler, StreamForm};
pub use schedule::learning_rate;
pub use trained::{Inputs, LogLine, SplitLoss, Trained};

use crate::learn::weights::Weights;
use crate::learn::{Checkpoints, LearnError};
use crate::plan::RunSpec;
use crate::progress::Progress;
use crate::spec::GeneratorSpec;

/// What is trained, on what, and where its state lies.
#[derive(Clone, Copy)]
pub struct Training<'a> {
    pub spec: &'a RunSpec,
    pub inputs: &'a Inputs<'a>,
    pub device: &'a Device,
    pub checkpoints: &'a Checkpoints<'a>,
}

/// A kind of generator.
pub trait Generator: Sync {
    /// Trains a run to its end and measures it on the test split.
    ///
    /// # Errors
    /// Codes or device do not suit the run; learning diverged or was stopped.
    fn train(
        &self,
        training: &Training,
        progress: &mut Progress,
    ) -> Result<Trained, GeneratorError>;

    /// Trains a trunk to its end and writes its state, from which runs branch off.
    ///
    /// # Errors
    /// As [`Generator::train`].
    fn train_trunk(
        &self,
        training: &Training,
        state: &Path,
        progress: &mut Progress,
    ) -> Result<(), GeneratorError>;

    /// A trained run that makes motions, without gradients, on `device`.
    ///
    /// # Errors
    /// [`GeneratorError::Weights`].
    fn sampler(
        &self,
        spec: &RunSpec,
        weights: Weights,
        device: &Device,
    ) -> Result<Box<dyn Sampler>, GeneratorError>;

    /// A run on made-up codes, whose steps can be timed. A model above [`MOST_PROBED_PARAMS`] is
    /// timed at a smaller size, and priced at the rate found there.
    fn probe(&self, spec: &RunSpec, device: &Device) -> Box<dyn Probe>;
}

/// Parameters of a model that a probe builds, at most.
pub const MOST_PROBED_PARAMS: usize = 4_000_000;

/// A run on made-up codes.
pub trait Probe {
    /// Takes a step that changes nothing.
    ///
    /// # Errors
    /// The device gives no number.
    fn step(&mut self) -> Result<(), LearnError>;

    /// FLOPs of a step, in the measure of the run's budget.
    fn flops(&self) -> f64;
}

/// The generator of a run.
pub fn of(spec: &RunSpec) -> &'static dyn Generator {
    match spec.generator {
        GeneratorSpec::Autoregressive(_) => &autoregressive::AutoregressiveGenerator,
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
