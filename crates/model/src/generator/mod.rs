//! Generators: models of codes given text. One folder per kind, each with a [`Kind`] and so a [`Generator`].
//!
//! Only [`of`] matches on the kind.
//!
//! The root of the program's crate, `isoflop`, has an example: from a sweep to a trained run in one process.

pub mod autoregressive;
mod inputs;
mod kind;
mod losses;
pub mod masked;
mod probed;
mod sampling;
pub mod scalewise;
pub(crate) mod stack;

use std::path::Path;

use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::learn::LearnError;
use crate::learn::weights::{self, Sources, Weights};
use crate::progress::Progress;
use crate::spec::{GeneratorSpec, Precision, RunSpec};
use kind::{learn, trained, weights_rng};
use probed::probed;

pub use inputs::{GeneratorError, Inputs, ScaleInputs};
pub use kind::{Kind, Network, Objective, Trained, Training, learning_rate};
pub use losses::{SplitLoss, Sums, losses_by_block};
pub use probed::{MOST_PROBED_PARAMS, Probe};
pub use sampling::{Draw, Edit, Prompt, Sampled, Sampler, Sampling};

/// The generator of a run.
pub fn of(spec: &RunSpec) -> &'static dyn Generator {
    match spec.generator {
        GeneratorSpec::Autoregressive(_) => &autoregressive::Autoregressive,
        GeneratorSpec::Masked(_) if spec.codes.scales.len() == 1 => &masked::Masked,
        GeneratorSpec::Masked(_) => &masked::residual::MaskedResidual,
        GeneratorSpec::Scalewise(_) => &scalewise::Scalewise,
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

/// The interface of a kind of generator.
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
    fn wants_scales(&self) -> bool;

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

impl<K: Kind> Generator for K {
    fn train(
        &self,
        training: &Training,
        progress: &mut Progress,
    ) -> Result<Trained, GeneratorError> {
        trained(&learn::<K>(training, progress)?)
    }

    fn first_weights(&self, spec: &RunSpec, device: &Device) -> Sources {
        let first = K::Network::drawn(spec, spec.precision, &mut weights_rng(spec), device);
        weights::of_module(first.weights())
    }

    fn train_trunk(
        &self,
        training: &Training,
        state: &Path,
        progress: &mut Progress,
    ) -> Result<(), GeneratorError> {
        Ok(learn::<K>(training, progress)?.save(state).map_err(LearnError::from)?)
    }

    fn wants_scales(&self) -> bool {
        K::WANTS_SCALES
    }

    fn sampler(
        &self,
        spec: &RunSpec,
        weights: Weights,
        device: &Device,
    ) -> Result<Box<dyn Sampler>, GeneratorError> {
        let mut unused = ChaCha8Rng::seed_from_u64(0);
        let mut network = K::Network::drawn(spec, Precision::F32, &mut unused, device);
        network.set_weights(weights::into_module(network.weights().clone(), weights)?);
        Ok(K::sampler(spec, network))
    }

    fn probe(&self, spec: &RunSpec, device: &Device) -> Box<dyn Probe> {
        Box::new(probed::<K>(spec, device))
    }
}
