//! [`Probed`]: a run on made-up clips, whose steps can be timed.

use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::batch::{Batch, Clip};
use super::model::{Model, ScalewiseTransformer};
use super::own::own;
use crate::codes::Grid;
use crate::generator::Probe;
use crate::generator::learner::course;
use crate::generator::measurable::measurable;
use crate::learn::{Course, LearnError, Learner, Learning};
use crate::plan::RunSpec;

/// A caption's words, at most.
const WORDS: usize = 12;

/// A small run of a spec's kind, at a rate of 0.
pub struct Probed {
    learning: Learning<Still>,
    flops: f64,
}

impl Probed {
    pub fn new(spec: &RunSpec, device: &Device) -> Self {
        let small = RunSpec { generator: measurable(&spec.generator, &spec.codes), ..spec.clone() };
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let device = device.clone().autodiff();
        let model = Model::init(own(&small), &spec.codes, spec.precision, &mut rng, &device);
        let batch = batch(&model, &spec.codes, spec.batch_tokens);
        let price = |run: &RunSpec| run.generator.flops_per_token(&run.codes, 0).openai as f64;
        let share = price(&small) / price(spec);
        let per_token = share * spec.budget_flops / spec.tokens() as f64;
        let flops = per_token * batch.n_targets() as f64;
        let course = Course { steps: usize::MAX, ..course(spec) };
        Self { learning: Learning::new(Still { model, batch }, &course), flops }
    }
}

impl Probe for Probed {
    fn step(&mut self) -> Result<(), LearnError> {
        self.learning.step().map(|_| ())
    }

    fn flops(&self) -> f64 {
        self.flops
    }
}

/// A model that is shown the same batch again and again.
struct Still {
    model: Model,
    batch: Batch,
}

impl Learner for Still {
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

    fn loss(&mut self, _: usize) -> Tensor<1> {
        self.model.loss(&self.batch)
    }

    fn learning_rate(&self, _: usize) -> f64 {
        0.0
    }

    fn advice(&self) -> &'static str {
        "the device gives wrong numbers"
    }
}

/// A step's batch of made-up clips, each as long as the longest.
fn batch(model: &Model, grid: &Grid, batch_tokens: usize) -> Batch {
    let spec = model.spec();
    let lengths = spec.longest(grid);
    let n_codes: usize = lengths.iter().sum();
    let words = WORDS.min(spec.shape.n_ctx - n_codes).max(1);
    let text = vec![0.5f32; spec.shape.d_text * words];
    let codes: Vec<u32> = vec![0; n_codes];
    let clip = Clip {
        text: &text,
        codes: &codes,
        inputs: lengths.iter().skip(1).map(|n| vec![0.5; n * spec.d_latent]).collect(),
        lengths,
        n_latents: spec.most_latents,
        supervised: 0..n_codes,
    };
    let clips = vec![clip; batch_tokens.div_ceil(n_codes)];
    Batch::pack(&clips, grid, spec.shape.d_text, model.places())
}
