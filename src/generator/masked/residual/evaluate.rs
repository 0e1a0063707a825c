//! The loss on a split, by layer and as a whole.
//!
//! Of the first layer a bound is measured, of each later one the likelihood, given the codes of the
//! layers before it: their sum is a bound on the nats of all codes.

use super::batch::{Asked, LayerBatch};
use super::model::ResidualModel;
use crate::codes::Grid;
use crate::generator::Inputs;
use crate::generator::passes::passes;
use crate::generator::sums::SplitSums;
use crate::progress::moved;

/// Takes in −ln p of the codes of each layer after the first.
pub fn later_layers(model: &ResidualModel, grid: &Grid, inputs: &Inputs, sums: &mut SplitSums) {
    let (tokens, split, n_layers) = (inputs.tokens, sums.split, grid.scales.len());
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
