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
use crate::generator::sums::SplitSums;
use crate::generator::{Inputs, SplitLoss};
use crate::progress::moved;

/// Measures both stages, each clip with one of its captions.
pub fn split_loss(stages: &Stages, grid: &Grid, inputs: &Inputs, split: Split) -> SplitLoss {
    let mut sums = SplitSums::by_scale(inputs.tokens, split);
    bound(&stages.base.frozen(), inputs, &mut sums);
    later_layers(stages, grid, inputs, &mut sums);
    sums.loss()
}

/// Takes in −ln p of the codes of each layer after the first.
fn later_layers(stages: &Stages, grid: &Grid, inputs: &Inputs, sums: &mut SplitSums) {
    let (model, tokens, n_layers) = (stages.residual.frozen(), inputs.tokens, grid.scales.len());
    let split = sums.split;
    for clips in passes(tokens, split) {
        let every_layer = |clip: usize| {
            let (text, codes) = (inputs.text.shown(split, clip), tokens.clip(split, clip));
            let places = 0..codes.len() / n_layers;
            (1..n_layers)
                .map(move |layer| Asked::of_clip(text, codes, n_layers, layer, places.clone()))
        };
        let asked: Vec<Asked> = clips.clone().flat_map(every_layer).collect();
        let batch = LayerBatch::pack(&asked, grid, inputs.text.dim());
        sums.add_scales(1, (&model.nll(&batch), &batch.targets), &clips);
        moved();
    }
}
