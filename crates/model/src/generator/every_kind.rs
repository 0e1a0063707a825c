//! [`Generator`]: what can be asked of every kind of generator.

use std::path::Path;

use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::kind::{Kind, Network, Probe, Training, learn, trained, weights_rng};
use super::trained::{GeneratorError, Trained};

use super::probed::probed;
use super::sampling::Sampler;

use crate::learn::LearnError;
use crate::learn::weights::{self, Sources, Weights};
use crate::progress::Progress;
use crate::spec::Precision;
use crate::spec::RunSpec;

/// What can be asked of a kind of generator.
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

    /// Whether it asks for [`Inputs::scales`](super::Inputs::scales).
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

    /// A run on made-up codes, whose steps can be timed. A model above [`MOST_PROBED_PARAMS`](super::MOST_PROBED_PARAMS) is
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
