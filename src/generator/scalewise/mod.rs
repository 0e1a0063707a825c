//! LG-Tok's scale-by-scale transformer (after MoSa and VAR): the codes of a scale are predicted all at
//! once, from the text, the length of the clip and the scales before.
//!
//! A sequence is `[text | scale 1 | scale 2 | …]`. The rows of scale 1 are learned; those of a later
//! scale are the sum of what the scales before it add to the tokenizer's latents, brought to its length
//! and projected. A row sees text and all rows of its own and earlier scales, and codes of one time have
//! one angle. Text stands in front, as in the autoregressive transformer; the released code reads it by
//! cross-attention.

mod batch;
mod evaluate;
mod model;
mod objective;
mod own;
mod places;
mod probe;
mod sample;
mod shown;

use std::path::Path;

use burn::tensor::Device;

pub use batch::{Batch, Clip};
pub use model::{Model, ScalewiseTransformer};
pub use objective::Scalewise;

use super::{Generator, GeneratorError, Probe, Sampler, Trained, Training, fitness, learner};
use crate::learn::weights::{self, Sources, Weights};
use crate::plan::RunSpec;
use crate::progress::Progress;

/// The scale-by-scale transformer as a kind of generator.
pub struct ScalewiseGenerator;

impl Generator for ScalewiseGenerator {
    fn train(
        &self,
        training: &Training,
        progress: &mut Progress,
    ) -> Result<Trained, GeneratorError> {
        learner::train(objective(training)?, training, progress)
    }

    fn first_weights(&self, spec: &RunSpec, device: &Device) -> Sources {
        weights::of_module(&objective::first_model(spec, device).weights)
    }

    fn train_trunk(
        &self,
        training: &Training,
        state: &Path,
        progress: &mut Progress,
    ) -> Result<(), GeneratorError> {
        learner::train_trunk(objective(training)?, training, state, progress)
    }

    fn wants_scales(&self) -> bool {
        true
    }

    fn sampler(
        &self,
        spec: &RunSpec,
        weights: Weights,
        device: &Device,
    ) -> Result<Box<dyn Sampler>, GeneratorError> {
        Ok(Box::new(sample::ScalewiseSampler::new(spec, weights, device)?))
    }

    fn probe(&self, spec: &RunSpec, device: &Device) -> Box<dyn Probe> {
        Box::new(probe::probed(spec, device))
    }
}

fn objective<'a>(training: &Training<'a>) -> Result<Scalewise<'a>, GeneratorError> {
    let Training { spec, inputs, device, .. } = *training;
    fitness::check_inputs(spec, inputs)?;
    fitness::check_precision(spec.precision, device)?;
    Ok(Scalewise::new(spec, inputs, device))
}
