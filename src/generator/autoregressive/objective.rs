//! [`NextCode`]: the transformer on the batches of a run.

use burn::tensor::Device;

use super::batch::Batch;
use super::evaluate::split_loss;
use super::stream::TokenStream;
use super::transformer::{Model, Transformer};
use crate::data::Split;
use crate::generator::learner::{BatchLoss, Objective, weights_rng};
use crate::generator::{Inputs, SplitLoss};
use crate::plan::RunSpec;
use crate::spec::flops::exact_of_sequence;

/// The cross-entropy of each next code.
pub struct NextCode<'a> {
    spec: &'a RunSpec,
    inputs: &'a Inputs<'a>,
    stream: TokenStream<'a>,
    model: Model,
}

impl<'a> NextCode<'a> {
    /// A model with the weights of a seed, on `device` in the run's precision.
    pub fn new(spec: &'a RunSpec, inputs: &'a Inputs<'a>, device: &Device) -> Self {
        let model = first_model(spec, &device.clone().autodiff());
        let stream = TokenStream::new(inputs.tokens, inputs.text, spec.seed).over(spec.share);
        Self { spec, inputs, stream, model: model.in_precision(spec.precision) }
    }
}

/// The model that a run begins with.
pub fn first_model(spec: &RunSpec, device: &Device) -> Model {
    Model::init(spec.shape(), spec.n_vocab(), &mut weights_rng(spec), device)
}

impl Objective for NextCode<'_> {
    type Weights = Transformer;

    fn weights(&self) -> &Transformer {
        &self.model.weights
    }

    fn set_weights(&mut self, weights: Transformer) {
        self.model.weights = weights;
    }

    fn device(&self) -> &Device {
        self.model.device()
    }

    fn loss(&mut self, step: usize) -> BatchLoss {
        let n = self.spec.batch_tokens;
        let batch = self.stream.batch(step * n, n);
        let forward_flops = forward_flops(self.spec, &batch);
        BatchLoss { loss: self.model.loss(&batch), forward_flops }
    }

    fn split_loss(&self, split: Split) -> SplitLoss {
        split_loss(&self.model.frozen(), self.inputs.tokens, self.inputs.text, split)
    }

    fn uniform_nats(&self) -> f64 {
        ((self.spec.n_vocab() + 1) as f64).ln()
    }
}

/// Multiply-adds of a batch, times two: each sequence at its own length, the head per target.
fn forward_flops(spec: &RunSpec, batch: &Batch) -> f64 {
    let layout = &batch.layout;
    let head = 2.0 * (spec.shape().d_model * (spec.n_vocab() + 1)) as f64;
    let blocks = (0..layout.n_sequences()).map(|i| {
        let prefix = layout.prefix(i) as f64;
        let targets = layout.len(i) as f64 - prefix + 1.0;
        exact_of_sequence(spec.shape(), spec.n_vocab(), prefix, targets) - targets * head
    });
    blocks.sum::<f64>() + batch.targets.len() as f64 * head
}
