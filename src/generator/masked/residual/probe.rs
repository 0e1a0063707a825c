//! [`Probed`]: both stages on made-up clips, whose steps can be timed.

use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::batch::{Asked, LayerBatch};
use super::stages::{StageWeights, Stages};
use crate::generator::Probe;
use crate::generator::autoregressive::{Batch, MOST_TOKENS, made_up_clip};
use crate::generator::learner::course;
use crate::generator::masked::batch::pack;
use crate::generator::masked::probe::hidden_clip;
use crate::generator::masked::shown::drawn_layer;
use crate::generator::measurable::measurable;
use crate::learn::{Course, LearnError, Learner, Learning};
use crate::plan::RunSpec;

/// A small run of a spec's kind, at a rate of 0.
pub struct Probed {
    learning: Learning<Still>,
    flops: f64,
}

impl Probed {
    /// The stages of a run, or smaller ones.
    pub fn new(spec: &RunSpec, device: &Device) -> Self {
        let small = RunSpec { generator: measurable(&spec.generator, &spec.codes), ..spec.clone() };
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let device = device.clone().autodiff();
        let stages = Stages::init(small.shape(), &small.codes, small.precision, &mut rng, &device);
        let (base, later) = batches(&small);
        let price = |run: &RunSpec| run.generator.flops_per_token(&run.codes, 0).openai as f64;
        let per_token = price(&small) / price(spec) * spec.budget_flops / spec.tokens() as f64;
        let tokens = 2 * later.n_targets();
        let course = Course { steps: usize::MAX, ..course(spec) };
        let still = Still { stages, base, later, device };
        Self { learning: Learning::new(still, &course), flops: per_token * tokens as f64 }
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

/// Stages that are shown the same batches again and again.
struct Still {
    stages: Stages,
    base: Batch,
    later: LayerBatch,
    device: Device,
}

impl Learner for Still {
    type Weights = StageWeights;

    fn weights(&self) -> &StageWeights {
        self.stages.weights()
    }

    fn set_weights(&mut self, weights: StageWeights) {
        self.stages.set_weights(weights);
    }

    fn device(&self) -> &Device {
        &self.device
    }

    fn loss(&mut self, _: usize) -> Tensor<1> {
        self.stages.loss(Some(&self.base), Some(&self.later))
    }

    fn learning_rate(&self, _: usize) -> f64 {
        0.0
    }

    fn advice(&self) -> &'static str {
        "the device gives wrong numbers"
    }
}

/// A step's batches of made-up clips, their layers as often as they are drawn.
fn batches(spec: &RunSpec) -> (Batch, LayerBatch) {
    let (shape, scales) = (spec.shape(), &spec.codes.scales);
    let fewest = scales.iter().map(|scale| scale.n_vocab).min().unwrap_or(1);
    let (text, codes) = made_up_clip(shape, fewest);
    let n_places = codes.len();
    let n_clips = spec.batch_tokens.min(MOST_TOKENS).div_ceil(2 * n_places);
    let hidden = vec![hidden_clip(&text, &codes, scales[0].n_vocab); n_clips];
    let all = codes.repeat(scales.len());
    let asked = (0..n_clips).map(|clip| {
        let layer = drawn_layer(scales.len(), (clip as f64 + 0.5) / n_clips as f64);
        Asked::of_clip(&text, &all, scales.len(), layer, 0..n_places)
    });
    let asked: Vec<Asked> = asked.collect();
    (pack(&hidden, shape.d_text), LayerBatch::pack(&asked, &spec.codes, shape.d_text))
}
