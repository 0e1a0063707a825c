//! [`TwoStages`]: the batches of a run of both stages.

use super::batch::{Asked, LayerBatch};
use super::evaluate::later_layers;
use super::stages::{StageBatches, Stages};
use crate::data::Split;
use crate::generator::autoregressive::{Part, TokenStream};
use crate::generator::learner::step_rng;
use crate::generator::masked::batch::{Hidden, pack};
use crate::generator::masked::evaluate::bound;
use crate::generator::masked::flops::forward_flops;
use crate::generator::masked::shown::Shown;
use crate::generator::sums::SplitSums;
use crate::generator::{Inputs, Objective, SplitLoss};
use crate::plan::RunSpec;
use crate::spec::ModelShape;
use crate::spec::flops::exact_whole;

/// The cross-entropy of hidden codes of the first layer, and of the codes of the others.
///
/// Both stages train side by side on the same clips. A place of a clip is two tokens: its code of the
/// first layer, hidden or not, and its code of the layer that is drawn for the clip. A step takes the next
/// `batch_tokens` of them; where that is odd, a place's two tokens stand in two steps.
pub struct TwoStages<'a> {
    spec: &'a RunSpec,
    inputs: &'a Inputs<'a>,
    stream: TokenStream<'a>,
    shown: Shown<'a>,
}

impl TwoStages<'_> {
    /// The places of a step for each stage. Token t belongs to place t / 2: the even ones to the first
    /// stage, the odd ones to the second.
    fn parts(&mut self, step: usize) -> [Vec<Part>; 2] {
        let (from, to) = (step * self.spec.batch_tokens, (step + 1) * self.spec.batch_tokens);
        let first = self.stream.parts(from.div_ceil(2), to.div_ceil(2) - from.div_ceil(2));
        [first, self.stream.parts(from / 2, to / 2 - from / 2)]
    }
}

impl<'a> Objective<'a> for TwoStages<'a> {
    type Network = Stages;

    fn new(spec: &'a RunSpec, inputs: &'a Inputs<'a>) -> Self {
        let stream = TokenStream::of_places(inputs.tokens, inputs.text, spec.seed).over(spec.share);
        Self { spec, inputs, stream, shown: Shown::new(spec, inputs) }
    }

    fn batch(&mut self, _: &Stages, step: usize) -> (StageBatches, f64) {
        let [first, later] = self.parts(step);
        let (spec, d_text) = (self.spec, self.inputs.text.dim());
        let mut rng = step_rng(spec, step);
        let hidden: Vec<Hidden> =
            first.iter().map(|part| self.shown.hidden(part, &mut rng)).collect();
        let asked: Vec<Asked> = later.iter().map(|part| self.shown.asked(part, &mut rng)).collect();
        let base = (!hidden.is_empty()).then(|| pack(&hidden, d_text));
        let later = (!asked.is_empty()).then(|| LayerBatch::pack(&asked, &spec.codes, d_text));
        let n_vocab = spec.codes.scales[0].n_vocab;
        let of_base = |batch| forward_flops(spec.shape(), n_vocab, &hidden, batch);
        let of_later = |batch| flops_of_layers(spec, batch);
        let flops = base.as_ref().map_or(0.0, of_base) + later.as_ref().map_or(0.0, of_later);
        (StageBatches { base, later }, flops)
    }

    fn split_loss(&self, stages: &Stages, split: Split) -> SplitLoss {
        let mut sums = SplitSums::by_scale(self.inputs.tokens, split);
        bound(&stages.base.frozen(), self.inputs, &mut sums);
        later_layers(&stages.residual.frozen(), &self.spec.codes, self.inputs, &mut sums);
        sums.loss()
    }

    /// Of the largest layer: an ignorant model is no worse on another.
    fn uniform_nats(&self) -> f64 {
        let largest = self.spec.codes.scales.iter().map(|scale| scale.n_vocab).max();
        ((largest.unwrap_or(1) + 1) as f64).ln()
    }
}

/// Multiply-adds of a batch of the second stage, times two: each clip at its own length, the heads per
/// target.
fn flops_of_layers(spec: &RunSpec, batch: &LayerBatch) -> f64 {
    let (shape, layout): (&ModelShape, _) = (spec.shape(), &batch.layout);
    let blocks = batch.n_places.iter().enumerate();
    let blocks = blocks.map(|(i, &n)| exact_whole(shape, 0, layout.len(i) - n, n, 0));
    let heads = spec.codes.scales[1..].iter().zip(&batch.targets);
    let heads = heads.map(|(scale, own)| own.codes.len() * shape.d_model * scale.n_vocab);
    blocks.sum::<f64>() + 2.0 * heads.sum::<usize>() as f64
}
