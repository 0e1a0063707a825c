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

/// Measures both stages, each clip with one of its captions; clip i shows caption i mod n.
pub fn split_loss(stages: &Stages, grid: &Grid, inputs: &Inputs, split: Split) -> SplitLoss {
    let mut sums = SplitSums::new(grid.scales.len(), inputs.tokens.n_clips(split));
    bound(&stages.base.frozen(), inputs, split, &mut sums);
    later_layers(stages, (grid, inputs), split, &mut sums);
    SplitLoss::of(sums, inputs.tokens.n_frames(split))
}

/// Takes in −ln p of the codes of each layer after the first.
fn later_layers(
    stages: &Stages,
    (grid, inputs): (&Grid, &Inputs),
    split: Split,
    sums: &mut SplitSums,
) {
    let (model, tokens, n_layers) = (stages.residual.frozen(), inputs.tokens, grid.scales.len());
    let unigrams: Vec<Vec<f64>> =
        (1..n_layers).map(|layer| tokens.unigram_log_probs(layer)).collect();
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
        for (later, nats) in model.nll(&batch).iter().enumerate() {
            let codes = batch.targets[later].codes.iter();
            let ln_p: Vec<f64> = codes.map(|&code| unigrams[later][code as usize]).collect();
            let layer = later + 1;
            let own = clips.clone().map(|clip| (clip, tokens.scale(split, clip, layer).len()));
            sums.add(layer, (nats, &ln_p), own);
        }
        moved();
    }
}
