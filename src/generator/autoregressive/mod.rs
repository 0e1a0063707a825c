//! ScaMo's text-prefix autoregressive transformer: model, batches, training, loss, sampling.
//!
//! Codes of several scales are one sequence, scale after scale, and the codebooks one vocabulary: V is
//! the sum of theirs. Such clips have no end token, since the lengths of the scales tell where they end;
//! its row and its logit stand unused, so that a model has the same shape for every grid.

mod batch;
mod decode;
mod evaluate;
mod objective;
mod probe;
mod sample;
mod stream;
mod transformer;

use std::path::Path;

use burn::tensor::Device;

pub use batch::{Batch, Sequence};
pub use evaluate::split_loss;
pub use objective::{NextCode, first_model};
pub(super) use probe::{MOST_TOKENS, made_up_clip, probed_on};
pub use stream::{Part, TokenStream};
pub use transformer::{Model, Transformer, end_token};

use super::{Generator, GeneratorError, Probe, Sampler, Trained, Training, fitness, learner};
use crate::learn::weights::{self, Sources, Weights};
use crate::plan::RunSpec;
use crate::progress::Progress;

/// The text-prefix autoregressive transformer as a kind of generator.
pub struct AutoregressiveGenerator;

impl Generator for AutoregressiveGenerator {
    fn train(
        &self,
        training: &Training,
        progress: &mut Progress,
    ) -> Result<Trained, GeneratorError> {
        learner::train(objective(training)?, training, progress)
    }

    fn first_weights(&self, spec: &RunSpec, device: &Device) -> Sources {
        weights::of_module(&first_model(spec, device).weights)
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
        Ok(Box::new(sample::AutoregressiveSampler::new(spec, weights, device)?))
    }

    fn probe(&self, spec: &RunSpec, device: &Device) -> Box<dyn Probe> {
        Box::new(probe::probed(spec, device))
    }
}

fn objective<'a>(training: &Training<'a>) -> Result<NextCode<'a>, GeneratorError> {
    let Training { spec, inputs, device, .. } = *training;
    fitness::check_inputs(spec, inputs)?;
    fitness::check_precision(spec.precision, device)?;
    Ok(NextCode::new(spec, inputs, device))
}
