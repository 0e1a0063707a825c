//! [`EachScale`]: the batches of a run of the scale-by-scale transformer.

use rand_chacha::ChaCha8Rng;

use super::batch::{Batch, Clip};
use super::evaluate::split_loss;
use super::model::{Model, own};
use crate::data::Split;
use crate::generator::autoregressive::{Part, TokenStream};
use crate::generator::learner::step_rng;
use crate::generator::{Inputs, Objective, SplitLoss};
use crate::learn::params::{below, unit};
use crate::plan::RunSpec;
use crate::spec::exact_of_clip;

/// The cross-entropy of the codes of each scale, given those before it.
///
/// As MoSa trains: a share of the codes is shown as random ones, and a share of the captions as one
/// vector of zeros. MoSa weighs its last scale as much as all others together; here every code counts
/// alike, so that the loss is the likelihood that laws are about.
pub struct EachScale<'a> {
    spec: &'a RunSpec,
    inputs: &'a Inputs<'a>,
    stream: TokenStream<'a>,
    /// The text of a caption that is left out.
    no_text: Vec<f32>,
}

impl EachScale<'_> {
    fn clip(&self, part: Part, rng: &mut ChaCha8Rng) -> Clip<'_> {
        let dropped = unit(rng) < own(self.spec).text_drop;
        let text = if dropped { &self.no_text } else { self.inputs.text.embedding(part.caption) };
        let (inputs, clip) = ((self.inputs, &self.spec.codes), (Split::Train, part.clip));
        Clip::of(inputs, clip, (text, part.targets), |codes, lengths| {
            self.corrupted(codes, lengths, rng)
        })
    }

    /// Codes of which a share is replaced by random ones of their scale.
    fn corrupted(&self, codes: &[u32], lengths: &[usize], rng: &mut ChaCha8Rng) -> Vec<u32> {
        let share = own(self.spec).corruption;
        let scales = self.spec.codes.scales.iter().zip(lengths);
        let vocabularies = scales.flat_map(|(scale, &n)| std::iter::repeat_n(scale.n_vocab, n));
        let shown = codes.iter().zip(vocabularies).map(|(&code, n_vocab)| {
            if unit(rng) < share { below(rng, n_vocab) as u32 } else { code }
        });
        shown.collect()
    }
}

impl<'a> Objective<'a> for EachScale<'a> {
    type Network = Model;

    fn new(spec: &'a RunSpec, inputs: &'a Inputs<'a>) -> Self {
        let stream = TokenStream::new(inputs.tokens, inputs.text, spec.seed).over(spec.share);
        Self { spec, inputs, stream, no_text: vec![0.0; spec.shape().d_text] }
    }

    fn batch(&mut self, model: &Model, step: usize) -> (Batch, f64) {
        let n = self.spec.batch_tokens;
        let parts = self.stream.parts(step * n, n);
        let mut rng = step_rng(self.spec, step);
        let clips: Vec<Clip> = parts.into_iter().map(|part| self.clip(part, &mut rng)).collect();
        let batch = Batch::pack(&clips, &self.spec.codes, self.inputs.text.dim(), model.places());
        let forward_flops = forward_flops(self.spec, &batch);
        (batch, forward_flops)
    }

    fn split_loss(&self, model: &Model, split: Split) -> SplitLoss {
        split_loss(&model.frozen(), self.inputs, split)
    }

    /// Of the largest scale: an ignorant model is no worse on another.
    fn uniform_nats(&self) -> f64 {
        let largest = self.spec.codes.scales.iter().map(|scale| scale.n_vocab).max();
        (largest.unwrap_or(1) as f64).ln()
    }
}

/// Multiply-adds of a batch, times two: each clip at its own lengths, the heads per target.
fn forward_flops(spec: &RunSpec, batch: &Batch) -> f64 {
    let (own, layout) = (own(spec), &batch.layout);
    let no_heads = vec![0; spec.codes.scales.len()];
    let clip = |i: usize| {
        let lengths = layout.block_lengths(i);
        exact_of_clip(own, &spec.codes, layout.prefix(i), &lengths, &no_heads)
    };
    let clips = (0..layout.n_sequences()).map(clip);
    let heads = spec.codes.scales.iter().zip(&batch.targets);
    let heads = heads.map(|(scale, own)| (2 * own.codes.len() * scale.n_vocab) as f64);
    clips.sum::<f64>() + spec.shape().d_model as f64 * heads.sum::<f64>()
}
