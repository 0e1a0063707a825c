//! [`Scalewise`]: the scale-by-scale transformer on the batches of a run.

use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::batch::{Batch, Clip};
use super::evaluate::split_loss;
use super::model::{Model, ScalewiseTransformer};
use super::own::own;
use super::shown::shown_clip;
use crate::data::Split;
use crate::generator::autoregressive::{Part, TokenStream};
use crate::generator::learner::{BatchLoss, FIRST_STEP_STREAM, Objective, weights_rng};
use crate::generator::{Inputs, SplitLoss};
use crate::learn::params::{below, unit};
use crate::plan::RunSpec;
use crate::spec::exact_of_clip;

/// The cross-entropy of the codes of each scale, given those before it.
///
/// As MoSa trains: a share of the codes is shown as random ones, and a share of the captions as one
/// vector of zeros. MoSa weighs its last scale as much as all others together; here every code counts
/// alike, so that the loss is the likelihood that laws are about.
pub struct Scalewise<'a> {
    spec: &'a RunSpec,
    inputs: &'a Inputs<'a>,
    stream: TokenStream<'a>,
    model: Model,
    /// The text of a caption that is left out.
    no_text: Vec<f32>,
}

impl<'a> Scalewise<'a> {
    /// A model with the weights of a seed, on `device` in the run's precision.
    pub fn new(spec: &'a RunSpec, inputs: &'a Inputs<'a>, device: &Device) -> Self {
        let model = first_model(spec, &device.clone().autodiff());
        let stream = TokenStream::new(inputs.tokens, inputs.text, spec.seed).over(spec.share);
        Self { spec, inputs, stream, model, no_text: vec![0.0; spec.shape().d_text] }
    }

    /// The batch of a step.
    fn batch(&mut self, step: usize) -> Batch {
        let n = self.spec.batch_tokens;
        let parts = self.stream.parts(step * n, n);
        let mut rng = ChaCha8Rng::seed_from_u64(self.spec.seed);
        rng.set_stream(FIRST_STEP_STREAM + step as u64);
        let clips: Vec<Clip> = parts.into_iter().map(|part| self.clip(part, &mut rng)).collect();
        Batch::pack(&clips, &self.spec.codes, self.inputs.text.dim(), self.model.places())
    }

    fn clip(&self, part: Part, rng: &mut ChaCha8Rng) -> Clip<'_> {
        let dropped = unit(rng) < own(self.spec).text_drop;
        let text = self.inputs.text.embedding(part.caption);
        let clip = self.inputs.tokens.clip(Split::Train, part.clip);
        let frames = self.inputs.tokens.clip_frames(Split::Train, part.clip);
        let lengths: Vec<usize> = self.spec.codes.lengths(frames).collect();
        let shown = self.corrupted(clip, &lengths, rng);
        shown_clip(self.inputs, &shown, frames, lengths, |own| Clip {
            text: if dropped { &self.no_text } else { text },
            codes: clip,
            supervised: part.targets,
            ..own
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

/// The model that a run begins with.
pub fn first_model(spec: &RunSpec, device: &Device) -> Model {
    Model::init(own(spec), &spec.codes, spec.precision, &mut weights_rng(spec), device)
}

impl Objective for Scalewise<'_> {
    type Weights = ScalewiseTransformer;

    fn weights(&self) -> &ScalewiseTransformer {
        &self.model.weights
    }

    fn set_weights(&mut self, weights: ScalewiseTransformer) {
        self.model.weights = weights;
    }

    fn device(&self) -> &Device {
        self.model.device()
    }

    fn loss(&mut self, step: usize) -> BatchLoss {
        let batch = self.batch(step);
        BatchLoss { loss: self.model.loss(&batch), forward_flops: forward_flops(self.spec, &batch) }
    }

    fn split_loss(&self, split: Split) -> SplitLoss {
        split_loss(&self.model.frozen(), &self.spec.codes, self.inputs, split)
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
