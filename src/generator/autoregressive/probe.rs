//! A run on made-up clips, whose steps can be timed.

use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::batch::{Batch, Sequence};
use super::transformer::{Model, Transformer, end_token};
use crate::generator::measurable::halve_heads;
use crate::generator::probed::{Probed, Still};
use crate::generator::{MOST_PROBED_PARAMS, Probe};
use crate::plan::RunSpec;
use crate::spec::ModelShape;
use crate::spec::flops::openai_per_token;

/// Tokens of a measured step at most, and logits.
pub const MOST_TOKENS: usize = 1024;
const MOST_LOGITS: usize = 1 << 24;
/// A caption's words and a clip's codes.
const WORDS: usize = 12;
const CODES: usize = 36;

/// A step's batch of made-up clips of a model of so many codes, of so many tokens or a few more; and how
/// many tokens it has.
type MadeUp = fn(&ModelShape, usize, usize) -> (Batch, usize);

/// A run on codes that are predicted one after another.
pub fn probed(spec: &RunSpec, device: &Device) -> impl Probe + use<> {
    probed_on(spec, device, batch)
}

/// A run of the same network on other batches.
pub fn probed_on(spec: &RunSpec, device: &Device, made_up: MadeUp) -> impl Probe + use<> {
    let (shape, n_vocab) = measurable(spec);
    let most_tokens = MOST_TOKENS.min(MOST_LOGITS / n_vocab);
    let (batch, tokens) = made_up(&shape, n_vocab, spec.batch_tokens.min(most_tokens));
    let full = openai_per_token(spec.shape(), spec.n_vocab()) as f64;
    let share = openai_per_token(&shape, n_vocab) as f64 / full;
    let flops_per_token = share * spec.budget_flops / spec.tokens() as f64;
    let flops = flops_per_token * tokens as f64;
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let model = Model::init(&shape, n_vocab, &mut rng, &device.clone().autodiff());
    Probed::new(spec, OnBatch { model, batch }, flops)
}

/// A model and its batch.
struct OnBatch {
    model: Model,
    batch: Batch,
}

impl Still for OnBatch {
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

    fn loss(&self) -> Tensor<1> {
        self.model.loss(&self.batch)
    }
}

/// The run's model, or a smaller one of its kind: fewer layers, then codes, then channels.
///
/// Nothing above the limit is built, so that a plan of billions of parameters can be priced on a
/// machine that could not hold them. Products of such widths run at one rate; what a smaller
/// vocabulary leaves out is of that kind too.
fn measurable(spec: &RunSpec) -> (ModelShape, usize) {
    let (mut model, mut n_vocab) = (spec.shape().clone(), spec.n_vocab());
    let too_large =
        |model: &ModelShape, n_vocab| model.params_of(n_vocab).total() > MOST_PROBED_PARAMS;
    while too_large(&model, n_vocab) && model.n_layer > 1 {
        model.n_layer = model.n_layer.div_ceil(2);
    }
    while too_large(&model, n_vocab) && n_vocab > 1024 {
        n_vocab /= 2;
    }
    while too_large(&model, n_vocab) && model.n_head > 1 {
        halve_heads(&mut model);
    }
    (model, n_vocab)
}

/// A step's batch of made-up clips, of an average one's length.
fn batch(shape: &ModelShape, n_vocab: usize, batch_tokens: usize) -> (Batch, usize) {
    let (text, codes) = made_up_clip(shape, n_vocab);
    let targets = codes.len() + 1;
    let clips = batch_tokens.div_ceil(targets);
    let sequence = Sequence { text: &text, codes: &codes, from: 0, to: targets };
    let batch = Batch::pack(&vec![sequence; clips], shape.d_text, end_token(n_vocab));
    (batch, clips * targets)
}

/// A text and codes of an average clip's length, as far as they fit the context.
pub fn made_up_clip(shape: &ModelShape, n_vocab: usize) -> (Vec<f32>, Vec<u32>) {
    let text = vec![0.5f32; shape.d_text * WORDS.min(shape.n_ctx / 2)];
    let codes = (0..CODES.min(shape.n_ctx / 2)).map(|i| (i * 7 % n_vocab) as u32);
    (text, codes.collect())
}
