//! A run on made-up clips, whose steps can be timed.

use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::batch::{Batch, Clip};
use super::model::{Model, ScalewiseTransformer};
use super::own::own;
use crate::codes::Grid;
use crate::generator::Probe;
use crate::generator::measurable::{measurable, price_of_token};
use crate::generator::probed::{Probed, Still};
use crate::plan::RunSpec;

/// A caption's words, at most.
const WORDS: usize = 12;

/// A small run of a spec's kind.
pub fn probed(spec: &RunSpec, device: &Device) -> impl Probe + use<> {
    let small = RunSpec { generator: measurable(&spec.generator, &spec.codes), ..spec.clone() };
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let device = device.clone().autodiff();
    let model = Model::init(own(&small), &spec.codes, spec.precision, &mut rng, &device);
    let batch = batch(&model, &spec.codes, spec.batch_tokens);
    let flops = price_of_token(spec, &small) * batch.n_targets() as f64;
    Probed::new(spec, OnBatch { model, batch }, flops)
}

/// A model and its batch.
struct OnBatch {
    model: Model,
    batch: Batch,
}

impl Still for OnBatch {
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

    fn loss(&self) -> Tensor<1> {
        self.model.loss(&self.batch)
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
