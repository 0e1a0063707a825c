//! [`NextCode`]: the batches of a run of the transformer.

use super::batch::Batch;
use super::evaluate::split_loss;
use super::stream::TokenStream;
use super::transformer::Model;
use crate::data::Split;
use crate::generator::{Inputs, Objective, SplitLoss};
use crate::plan::RunSpec;
use crate::spec::flops::exact_of_sequence;

/// The cross-entropy of each next code.
pub struct NextCode<'a> {
    spec: &'a RunSpec,
    inputs: &'a Inputs<'a>,
    stream: TokenStream<'a>,
}

impl<'a> Objective<'a> for NextCode<'a> {
    type Network = Model;

    fn new(spec: &'a RunSpec, inputs: &'a Inputs<'a>) -> Self {
        let stream = TokenStream::new(inputs.tokens, inputs.text, spec.seed).over(spec.share);
        Self { spec, inputs, stream }
    }

    fn batch(&mut self, _: &Model, step: usize) -> (Batch, f64) {
        let n = self.spec.batch_tokens;
        let batch = self.stream.batch(step * n, n);
        let forward_flops = forward_flops(self.spec, &batch);
        (batch, forward_flops)
    }

    fn split_loss(&self, model: &Model, split: Split) -> SplitLoss {
        split_loss(&model.frozen(), self.inputs, split)
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
