//! [`Probe`]: a model on made-up clips that stay the same, whose steps can be timed.

use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::inputs::check_precision;
use super::kind::{Kind, Network, course};
use crate::learn::{Course, LearnError, Learner, Learning};
use crate::spec::{ModelShape, Precision, RunSpec};

/// Parameters of a model that a probe builds, at most.
pub const MOST_PROBED_PARAMS: usize = 4_000_000;

/// A run on made-up codes.
pub trait Probe {
    /// Takes a step that changes nothing.
    ///
    /// # Errors
    /// The device gives no number.
    fn step(&mut self) -> Result<(), LearnError>;

    /// FLOPs of a step, in the measure of the run's budget.
    fn flops(&self) -> f64;
}

/// Tokens of a measured step at most, for kinds whose clips are short.
pub const MOST_TOKENS: usize = 1024;

/// A caption's words at most, and a clip's codes.
pub const WORDS: usize = 12;
const CODES: usize = 36;

/// A text and codes of an average clip's length, cut to the context.
pub fn made_up_clip(shape: &ModelShape, n_vocab: usize) -> (Vec<f32>, Vec<u32>) {
    let text = vec![0.5f32; shape.d_text * WORDS.min(shape.n_ctx / 2)];
    let codes = (0..CODES.min(shape.n_ctx / 2)).map(|i| (i * 7 % n_vocab) as u32);
    (text, codes.collect())
}

/// A run of a kind, or a small one, on a batch that it is shown again and again; in single precision where
/// the device has no other.
pub fn probed<K: Kind>(spec: &RunSpec, device: &Device) -> impl Probe + use<K> {
    let small = measurable(spec);
    let precision =
        check_precision(spec.precision, device).map_or(Precision::F32, |()| spec.precision);
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let network = K::Network::drawn(&small, precision, &mut rng, &device.clone().autodiff());
    let (batch, tokens) = K::made_up(&small, &network);
    let price = |run: &RunSpec| run.generator.flops_per_token(&run.codes, 0).openai as f64;
    let of_token = price(&small) / price(spec) * spec.budget_flops / spec.tokens() as f64;
    let course = Course { steps: usize::MAX, ..course(spec) };
    Probed {
        learning: Learning::new(Resting { network, batch }, &course),
        flops: of_token * tokens as f64,
    }
}

/// A run, or one of its kind with fewer layers, then codes, then heads.
///
/// Nothing above the limit is built, so a plan of billions of parameters can be priced on a machine without memory for
/// them. Products of such widths run at one rate, also those that a smaller vocabulary leaves out.
fn measurable(spec: &RunSpec) -> RunSpec {
    let mut small = spec.clone();
    let is_large = |run: &RunSpec| run.generator.params(&run.codes).total() > MOST_PROBED_PARAMS;
    while is_large(&small) && small.shape().n_layer > 1 {
        let shape = small.generator.shape_mut();
        shape.n_layer = shape.n_layer.div_ceil(2);
    }
    while is_large(&small) && small.n_vocab() > 1024 {
        small.codes.scales.iter_mut().for_each(|scale| scale.n_vocab = scale.n_vocab.div_ceil(2));
    }
    while is_large(&small) && small.shape().n_head > 1 {
        halve_heads(small.generator.shape_mut());
    }
    small
}

/// Half of the heads, of the same width each, and as much less of the feed-forward width.
fn halve_heads(shape: &mut ModelShape) {
    let head_dim = shape.d_model / shape.n_head;
    let n_head = shape.n_head / 2;
    shape.d_ff = (shape.d_ff * n_head / shape.n_head).max(1);
    (shape.n_head, shape.d_model) = (n_head, n_head * head_dim);
}

/// A small run of a spec's kind, at a rate of 0.
struct Probed<N: Network> {
    learning: Learning<Resting<N>>,
    flops: f64,
}

impl<N: Network> Probe for Probed<N> {
    fn step(&mut self) -> Result<(), LearnError> {
        self.learning.step().map(|_| ())
    }

    fn flops(&self) -> f64 {
        self.flops
    }
}

/// A learner whose steps change nothing.
struct Resting<N: Network> {
    network: N,
    batch: N::Batch,
}

impl<N: Network> Learner for Resting<N> {
    type Weights = N::Weights;

    fn weights(&self) -> &N::Weights {
        self.network.weights()
    }

    fn set_weights(&mut self, weights: N::Weights) {
        self.network.set_weights(weights);
    }

    fn loss(&mut self, _: usize) -> Tensor<1> {
        self.network.loss(&self.batch)
    }

    fn learning_rate(&self, _: usize) -> f64 {
        0.0
    }

    fn advice(&self) -> &'static str {
        "the device gives wrong numbers"
    }
}
