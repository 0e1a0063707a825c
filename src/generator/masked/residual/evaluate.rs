//! The loss on a split, by layer and as a whole.
//!
//! Of the first layer a bound is measured, of each later one the likelihood, given the codes of the
//! layers before it: their sum is a bound on the nats of all codes.

use super::batch::{Asked, LayerBatch};
use super::stages::Stages;
use crate::codes::Grid;
use crate::data::Split;
use crate::generator::masked::evaluate::bound;
use crate::generator::passes::passes;
use crate::generator::sums::Sums;
use crate::generator::{Inputs, SplitLoss};
use crate::progress::moved;

/// Measures both stages, each clip with one of its captions; clip i shows caption i mod n.
pub fn split_loss(stages: &Stages, grid: &Grid, inputs: &Inputs, split: Split) -> SplitLoss {
    let first = bound(&stages.base.frozen(), inputs, split);
    let later = later_layers(stages, grid, inputs, split);
    let clips = first.into_iter().zip(later).map(|(first, later)| [vec![first], later].concat());
    Sums::split_loss(&clips.collect::<Vec<_>>(), inputs.tokens.n_frames(split))
}

/// −ln p of the codes of each layer after the first, clip by clip.
fn later_layers(stages: &Stages, grid: &Grid, inputs: &Inputs, split: Split) -> Vec<Vec<Sums>> {
    let (model, tokens, n_layers) = (stages.residual.frozen(), inputs.tokens, grid.scales.len());
    let unigrams: Vec<Vec<f64>> =
        (1..n_layers).map(|layer| tokens.unigram_log_probs(layer)).collect();
    let mut sums = Vec::with_capacity(tokens.n_clips(split));
    for clips in passes(tokens, split) {
        let every_layer = |clip: usize| {
            let captions = inputs.text.captions(split, clip);
            let text = inputs.text.embedding(captions[clip % captions.len()]);
            let codes = tokens.clip(split, clip);
            let places = 0..codes.len() / n_layers;
            (1..n_layers)
                .map(move |layer| Asked::of_clip(text, codes, n_layers, layer, places.clone()))
        };
        let asked: Vec<Asked> = clips.clone().flat_map(every_layer).collect();
        let batch = LayerBatch::pack(&asked, grid, inputs.text.dim());
        let mut nats: Vec<_> = model.nll(&batch).into_iter().map(Vec::into_iter).collect();
        for clip in clips {
            let layers = nats.iter_mut().zip(&unigrams).enumerate();
            let of_layer = layers.map(|(later, (nats, unigram))| {
                let codes = tokens.scale(split, clip, later + 1);
                let ln_p = codes.iter().map(|&code| unigram[code as usize]);
                Sums::of(nats.by_ref().take(codes.len()), ln_p)
            });
            sums.push(of_layer.collect());
        }
        moved();
    }
    sums
}
