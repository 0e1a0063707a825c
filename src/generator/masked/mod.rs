//! MoMask's masked transformer: hidden codes are predicted from the text and the codes that are not
//! hidden; motions are made in a few rounds, the surest codes first. Codes of several layers have a
//! second transformer ([`residual`]).
//!
//! The network is the autoregressive transformer's, parameter for parameter, so that the two differ in
//! what they are asked alone. MoMask's own has post-norm, biases and sinusoidal positions, and the
//! sentence as one token in front.

mod batch;
mod evaluate;
mod flops;
mod making;
mod objective;
mod own;
mod probe;
pub mod residual;
mod sample;
mod shown;

use std::path::Path;

use burn::tensor::Device;

pub use batch::{Hidden, pack};
pub use evaluate::split_loss;
pub use objective::HiddenCodes;

use super::autoregressive::first_model;
use super::{Generator, GeneratorError, Probe, Sampler, Trained, Training, fitness, learner};
use crate::learn::weights::{self, Sources, Weights};
use crate::plan::RunSpec;
use crate::progress::Progress;
use residual::{TwoStages, first_stages};

/// The masked transformer as a kind of generator.
pub struct MaskedGenerator;

impl Generator for MaskedGenerator {
    fn train(
        &self,
        training: &Training,
        progress: &mut Progress,
    ) -> Result<Trained, GeneratorError> {
        let Training { spec, inputs, device, .. } = *checked(training)?;
        match has_second_stage(spec) {
            true => learner::train(TwoStages::new(spec, inputs, device), training, progress),
            false => learner::train(HiddenCodes::new(spec, inputs, device), training, progress),
        }
    }

    fn first_weights(&self, spec: &RunSpec, device: &Device) -> Sources {
        match has_second_stage(spec) {
            true => weights::of_module(first_stages(spec, device).weights()),
            false => weights::of_module(&first_model(spec, device).weights),
        }
    }

    fn train_trunk(
        &self,
        training: &Training,
        state: &Path,
        progress: &mut Progress,
    ) -> Result<(), GeneratorError> {
        let Training { spec, inputs, device, .. } = *checked(training)?;
        if has_second_stage(spec) {
            let stages = TwoStages::new(spec, inputs, device);
            return learner::train_trunk(stages, training, state, progress);
        }
        learner::train_trunk(HiddenCodes::new(spec, inputs, device), training, state, progress)
    }

    fn sampler(
        &self,
        spec: &RunSpec,
        weights: Weights,
        device: &Device,
    ) -> Result<Box<dyn Sampler>, GeneratorError> {
        Ok(Box::new(sample::MaskedSampler::new(spec, weights, device)?))
    }

    fn probe(&self, spec: &RunSpec, device: &Device) -> Box<dyn Probe> {
        match has_second_stage(spec) {
            true => Box::new(residual::probed(spec, device)),
            false => Box::new(probe::probed(spec, device)),
        }
    }
}

/// Whether codes have layers after the first.
fn has_second_stage(spec: &RunSpec) -> bool {
    spec.codes.scales.len() > 1
}

/// A training that can be done.
fn checked<'a, 'b>(training: &'b Training<'a>) -> Result<&'b Training<'a>, GeneratorError> {
    let Training { spec, inputs, device, .. } = *training;
    fitness::check_inputs(spec, inputs)?;
    fitness::check_precision(spec.precision, device)?;
    Ok(training)
}
