//! MoMask's second stage, for codes of several layers: the codes of a layer all at once, from the text
//! and the codes of the layers before it.
//!
//! A place of a clip is one position: the sum of the embeddings of its codes in the layers before, and
//! a learned vector of the layer that is asked for. Every position of `[text | places]` sees every other.
//! The network has the shape of the first stage and no parameter of it. MoMask gives the layer as a
//! position of its own, and takes its heads from the embeddings; here each layer has a head of its own,
//! as the scales of the scale-by-scale transformer have, but where `model.tie_embeddings` asks for
//! MoMask's.

pub mod batch;
mod evaluate;
mod model;
mod objective;
mod sample;
mod stages;

pub use batch::{Asked, LayerBatch};
pub use model::{ResidualModel, ResidualTransformer};
pub(super) use sample::draw_layers;
pub use stages::{StageBatches, StageWeights, Stages};

use super::batch::{hidden_clip, pack};
use super::sample::MaskedSampler;
use super::shown::drawn_layer;
use crate::generator::probed::{MOST_TOKENS, made_up_clip};
use crate::generator::{Kind, Sampler};
use crate::plan::RunSpec;

/// Both masked transformers, for codes of several layers, as a kind of generator.
pub struct MaskedResidual;

impl Kind for MaskedResidual {
    type Network = Stages;
    type Objective<'a> = objective::TwoStages<'a>;

    fn sampler(spec: &RunSpec, stages: Stages) -> Box<dyn Sampler> {
        Box::new(MaskedSampler::new(spec, stages.base, Some(stages.residual)))
    }

    /// Layers are asked for as often as they are drawn.
    fn made_up(spec: &RunSpec, _: &Stages) -> (StageBatches, usize) {
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
        let base = Some(pack(&hidden, shape.d_text));
        let later = Some(LayerBatch::pack(&asked, &spec.codes, shape.d_text));
        (StageBatches { base, later }, 2 * n_clips * n_places)
    }
}
