//! ScaMo's text-prefix autoregressive transformer: model, batches, training, loss.
//!
//! Codes of several scales are one sequence, scale after scale, and the codebooks one vocabulary: V is
//! the sum of theirs. Such clips have no end token, since the lengths of the scales tell where they end;
//! its row and its logit stand unused, so that a model has the same shape for every grid.

mod batch;
mod evaluate;
mod fitness;
mod learner;
mod probe;
mod schedule;
mod stream;
mod transformer;

use std::path::Path;

use burn::tensor::Device;

pub use batch::{Batch, Sequence};
pub use evaluate::split_loss;
pub use learner::Autoregressive;
pub use schedule::learning_rate;
pub use stream::TokenStream;
pub use transformer::{Model, Transformer, end_token};

use super::{Generator, GeneratorError, Probe, Trained, Training};
use crate::data::Split;
use crate::learn::{LearnError, Learning, weights};
use crate::plan::RunSpec;
use crate::progress::Progress;
use crate::spec::flops::TRAINING_PER_FORWARD;

/// The text-prefix autoregressive transformer as a kind of generator.
pub struct AutoregressiveGenerator;

impl Generator for AutoregressiveGenerator {
    fn train(
        &self,
        training: &Training,
        progress: &mut Progress,
    ) -> Result<Trained, GeneratorError> {
        let learning = learn(training, progress)?;
        let learner = learning.learner();
        let model = learner.frozen();
        Ok(Trained {
            weights: weights::of_module(&model.weights),
            test: learner.measure(&model, Split::Test, training.spec.steps)?,
            log: learner.log().to_vec(),
            flops_exact: TRAINING_PER_FORWARD * learner.forward_flops(),
            wall_s: learning.wall_s(),
        })
    }

    fn train_trunk(
        &self,
        training: &Training,
        state: &Path,
        progress: &mut Progress,
    ) -> Result<(), GeneratorError> {
        let learning = learn(training, progress)?;
        Ok(learning.save(state).map_err(LearnError::from)?)
    }

    fn probe(&self, spec: &RunSpec, device: &Device) -> Box<dyn Probe> {
        Box::new(probe::Probed::new(spec, device))
    }
}

fn learn<'a>(
    training: &Training<'a>,
    progress: &mut Progress,
) -> Result<Learning<Autoregressive<'a>>, GeneratorError> {
    let Training { spec, inputs, device, checkpoints } = *training;
    fitness::check_inputs(spec, inputs)?;
    fitness::check_precision(spec.precision, device)?;
    let learner = Autoregressive::new(spec, inputs, device);
    Ok(Learning::run(learner, &learner::course(spec), Some(checkpoints), progress)?)
}
