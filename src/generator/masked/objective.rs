//! [`HiddenCodes`]: the masked transformer on the batches of a run.

use std::f64::consts::FRAC_PI_2;

use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::batch::{Hidden, pack};
use super::evaluate::split_loss;
use super::own::own;
use crate::data::Split;
use crate::generator::autoregressive::{Batch, Model, Part, TokenStream, Transformer};
use crate::generator::learner::{BatchLoss, FIRST_STEP_STREAM, Objective, WEIGHTS_STREAM};
use crate::generator::{Inputs, SplitLoss};
use crate::learn::params::unit;
use crate::plan::RunSpec;
use crate::spec::flops::exact_whole;

/// The cross-entropy of hidden codes.
///
/// As MoMask trains: of a clip the share cos(π u / 2) is hidden, u drawn from 0 to 1, and one code at
/// least; a share of the captions is left out, as one vector of zeros. MoMask shows a tenth of the
/// hidden codes as random ones and a tenth as they are; here the first is `model.corruption` and the
/// second is left out.
pub struct HiddenCodes<'a> {
    spec: &'a RunSpec,
    inputs: &'a Inputs<'a>,
    stream: TokenStream<'a>,
    model: Model,
    /// The text of a caption that is left out.
    no_text: Vec<f32>,
}

impl<'a> HiddenCodes<'a> {
    /// A model with the weights of a seed, on `device` in the run's precision.
    pub fn new(spec: &'a RunSpec, inputs: &'a Inputs<'a>, device: &Device) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(spec.seed);
        rng.set_stream(WEIGHTS_STREAM);
        let model = Model::init(spec.shape(), spec.n_vocab(), &mut rng, &device.clone().autodiff());
        let stream = TokenStream::of_codes(inputs.tokens, inputs.text, spec.seed);
        let no_text = vec![0.0; spec.shape().d_text];
        Self { spec, inputs, stream, model: model.in_precision(spec.precision), no_text }
    }

    /// The batch of a step, and the codes that go through the network.
    fn batch(&mut self, step: usize) -> (Batch, Vec<usize>) {
        let n = self.spec.batch_tokens;
        let parts = self.stream.parts(step * n, n);
        let mut rng = ChaCha8Rng::seed_from_u64(self.spec.seed);
        rng.set_stream(FIRST_STEP_STREAM + step as u64);
        let clips: Vec<Hidden> = parts.iter().map(|part| self.clip(part, &mut rng)).collect();
        let codes = clips.iter().map(|clip| clip.shown.len()).collect();
        (pack(&clips, self.inputs.text.dim()), codes)
    }

    /// Codes of the whole clip are hidden, and those of the part at hand supervised: at least one.
    fn clip(&self, part: &Part, rng: &mut ChaCha8Rng) -> Hidden<'_> {
        let (own, n_vocab) = (own(self.spec), self.spec.n_vocab());
        let codes = self.inputs.tokens.clip(Split::Train, part.clip);
        let text = self.inputs.text.embedding(part.caption);
        let text = if unit(rng) < own.text_drop { &self.no_text } else { text };
        let share = (FRAC_PI_2 * unit(rng)).cos();
        let n_hidden = ((share * codes.len() as f64).round() as usize).clamp(1, codes.len());
        let mut clip = Hidden::some(text, codes, n_hidden, n_vocab, rng);
        clip.targets.retain(|(place, _)| part.targets.contains(place));
        if clip.targets.is_empty() {
            let place = part.targets.start;
            clip.shown[place] = n_vocab as u32;
            clip.targets.push((place, codes[place]));
        }
        for (place, _) in clip.targets.clone() {
            if unit(rng) < own.corruption {
                clip.corrupt(place, n_vocab, rng);
            }
        }
        clip
    }
}

impl Objective for HiddenCodes<'_> {
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
        let (batch, codes) = self.batch(step);
        let (shape, n_vocab) = (self.spec.shape(), self.spec.n_vocab());
        let clips = codes
            .iter()
            .enumerate()
            .map(|(i, &n)| exact_whole(shape, n_vocab, batch.layout.len(i) - n, n, 0));
        let heads = 2.0 * (batch.targets.len() * shape.d_model * (n_vocab + 1)) as f64;
        let forward_flops = clips.sum::<f64>() + heads;
        BatchLoss { loss: self.model.loss(&batch), forward_flops }
    }

    fn split_loss(&self, split: Split) -> SplitLoss {
        split_loss(&self.model.frozen(), self.inputs, split)
    }

    fn uniform_nats(&self) -> f64 {
        ((self.spec.n_vocab() + 1) as f64).ln()
    }
}
