//! Both stages on made-up clips, whose steps can be timed.

use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::batch::{Asked, LayerBatch};
use super::stages::{StageWeights, Stages};
use crate::generator::Probe;
use crate::generator::autoregressive::{Batch, MOST_TOKENS, made_up_clip};
use crate::generator::masked::batch::pack;
use crate::generator::masked::probe::hidden_clip;
use crate::generator::masked::shown::drawn_layer;
use crate::generator::measurable::{measurable, price_of_token};
use crate::generator::probed::{Probed, Still};
use crate::plan::RunSpec;

/// The stages of a run, or smaller ones.
pub fn probed(spec: &RunSpec, device: &Device) -> impl Probe + use<> {
    let small = RunSpec { generator: measurable(&spec.generator, &spec.codes), ..spec.clone() };
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let device = device.clone().autodiff();
    let stages = Stages::init(small.shape(), &small.codes, small.precision, &mut rng, &device);
    let (base, later) = batches(&small);
    let tokens = 2 * later.n_targets();
    let flops = price_of_token(spec, &small) * tokens as f64;
    Probed::new(spec, OnBatches { stages, base, later, device }, flops)
}

/// Stages and the batch of each.
struct OnBatches {
    stages: Stages,
    base: Batch,
    later: LayerBatch,
    device: Device,
}

impl Still for OnBatches {
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

    fn loss(&self) -> Tensor<1> {
        self.stages.loss(Some(&self.base), Some(&self.later))
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
