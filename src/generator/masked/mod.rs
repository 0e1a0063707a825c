//! MoMask's masked transformer, for codes of one codebook: hidden codes are predicted from the text and
//! the codes that are not hidden; motions are made in a few rounds, the surest codes first.
//!
//! The network is the autoregressive transformer's, parameter for parameter, so that the two differ in
//! what they are asked alone. MoMask's own has post-norm, biases and sinusoidal positions, and the
//! sentence as one token in front.

mod batch;
mod evaluate;
mod objective;
mod own;
mod sample;

use std::path::Path;

use burn::tensor::Device;

pub use batch::{Hidden, pack};
pub use evaluate::split_loss;
pub use objective::HiddenCodes;

use super::autoregressive::Probed;
use super::{Generator, GeneratorError, Probe, Sampler, Trained, Training, fitness, learner};
use crate::learn::weights::Weights;
use crate::plan::RunSpec;
use crate::progress::Progress;

/// The masked transformer as a kind of generator.
pub struct MaskedGenerator;

impl Generator for MaskedGenerator {
    fn train(
        &self,
        training: &Training,
        progress: &mut Progress,
    ) -> Result<Trained, GeneratorError> {
        learner::train(objective(training)?, training, progress)
    }

    fn train_trunk(
        &self,
        training: &Training,
        state: &Path,
        progress: &mut Progress,
    ) -> Result<(), GeneratorError> {
        learner::train_trunk(objective(training)?, training, state, progress)
    }

    fn sampler(
        &self,
        spec: &RunSpec,
        weights: Weights,
        device: &Device,
    ) -> Result<Box<dyn Sampler>, GeneratorError> {
        Ok(Box::new(sample::MaskedSampler::new(spec, weights, device)?))
    }

    /// A step takes as long as one of the autoregressive transformer.
    fn probe(&self, spec: &RunSpec, device: &Device) -> Box<dyn Probe> {
        Box::new(Probed::new(spec, device))
    }
}

fn objective<'a>(training: &Training<'a>) -> Result<HiddenCodes<'a>, GeneratorError> {
    let Training { spec, inputs, device, .. } = *training;
    fitness::check_inputs(spec, inputs)?;
    fitness::check_precision(spec.precision, device)?;
    Ok(HiddenCodes::new(spec, inputs, device))
}
