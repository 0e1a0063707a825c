//! [`Stages`]: both stages as one model.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::batch::LayerBatch;
use super::model::{ResidualModel, ResidualTransformer};
use crate::codes::Grid;
use crate::generator::Network;
use crate::generator::autoregressive::{Batch, Model, Transformer};
use crate::plan::RunSpec;
use crate::spec::{ModelShape, Precision};

/// The parameters of both stages, which share none.
#[derive(Module, Debug)]
pub struct StageWeights {
    base: Transformer,
    residual: ResidualTransformer,
}

/// What a step shows each stage, where it shows it anything.
pub struct StageBatches {
    pub base: Option<Batch>,
    pub later: Option<LayerBatch>,
}

/// The stage that makes the codes of the first layer, and the one that makes all others.
#[derive(Clone, Debug)]
pub struct Stages {
    pub base: Model,
    pub residual: ResidualModel,
    /// The same parameters as those of `base` and `residual`.
    weights: StageWeights,
    n_layers: usize,
}

impl Stages {
    /// Stages of one shape with drawn parameters; on an autodiff device they can be trained.
    pub fn init(
        shape: &ModelShape,
        grid: &Grid,
        precision: Precision,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let base = Model::init(shape, grid.scales[0].n_vocab, rng, device).in_precision(precision);
        let residual = ResidualModel::init(shape, grid, precision, rng, device);
        let weights =
            StageWeights { base: base.weights.clone(), residual: residual.weights.clone() };
        Self { base, residual, weights, n_layers: grid.scales.len() }
    }
}

impl Network for Stages {
    type Weights = StageWeights;
    type Batch = StageBatches;

    fn drawn(spec: &RunSpec, precision: Precision, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        Self::init(spec.shape(), &spec.codes, precision, rng, device)
    }

    fn weights(&self) -> &StageWeights {
        &self.weights
    }

    fn set_weights(&mut self, weights: StageWeights) {
        self.base.weights = weights.base.clone();
        self.residual.weights = weights.residual.clone();
        self.weights = weights;
    }

    /// The loss of a step, in nats a code, `[1]`: (1/K) of the mean over the hidden codes of the first
    /// layer and (K − 1)/K of the mean over the codes that the second stage was asked for.
    ///
    /// Layers that were drawn evenly would so make it the nats a code of the whole stream, apart from
    /// what `HiddenCodes` says of the first. Of the others each
    /// weighs as it is drawn. The stages share no parameter, so that the weight of either tells on the
    /// other by the norm at which gradients are clipped alone. A step that has codes of one stage has
    /// that one's mean.
    fn loss(&self, batches: &StageBatches) -> Tensor<1> {
        let first = batches.base.as_ref().map(|batch| self.base.loss(batch));
        let later = batches.later.as_ref().map(|batch| self.residual.loss(batch));
        let share = 1.0 / self.n_layers as f64;
        match (first, later) {
            (Some(first), Some(later)) => first * share + later * (1.0 - share),
            (first, later) => first.or(later).expect("a step supervises something"),
        }
    }
}
