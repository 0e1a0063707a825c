//! [`Generator`]: what a kind of generator does.

use std::path::Path;

use burn::tensor::Device;

use super::error::GeneratorError;
use super::sampling::Sampler;
use super::trained::{Inputs, Trained};
use crate::learn::weights::{Sources, Weights};
use crate::learn::{Checkpoints, LearnError};
use crate::plan::RunSpec;
use crate::progress::Progress;

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

    /// The weights that a run begins with, by name.
    fn first_weights(&self, spec: &RunSpec, device: &Device) -> Sources;

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

    /// Whether it asks for [`Inputs::scales`].
    fn wants_scales(&self) -> bool {
        false
    }

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
