//! The loss on a split, by scale and as a whole.

use super::batch::{Batch, Clip};
use super::model::Model;
use super::shown::shown_clip;
use crate::codes::Grid;
use crate::data::Split;
use crate::generator::passes::passes;
use crate::generator::sums::SplitSums;
use crate::generator::{Inputs, SplitLoss};
use crate::progress::moved;

/// Measures a model, each clip once with one of its captions; clip i shows caption i mod n.
pub fn split_loss(model: &Model, grid: &Grid, inputs: &Inputs, split: Split) -> SplitLoss {
    let tokens = inputs.tokens;
    let unigrams: Vec<Vec<f64>> =
        (0..grid.scales.len()).map(|scale| tokens.unigram_log_probs(scale)).collect();
    let mut sums = SplitSums::new(grid.scales.len(), tokens.n_clips(split));
    for clips in passes(tokens, split) {
        let shown: Vec<Clip> = clips.clone().map(|clip| shown(grid, inputs, split, clip)).collect();
        let batch = Batch::pack(&shown, grid, inputs.text.dim(), model.places());
        for (scale, nats) in model.nll(&batch).iter().enumerate() {
            let codes = batch.targets[scale].codes.iter();
            let ln_p: Vec<f64> = codes.map(|&code| unigrams[scale][code as usize]).collect();
            let own = clips.clone().map(|clip| (clip, tokens.scale(split, clip, scale).len()));
            sums.add(scale, (nats, &ln_p), own);
        }
        moved();
    }
    SplitLoss::of(sums, tokens.n_frames(split))
}

/// A clip that is shown its own codes, all of them supervised.
fn shown<'a>(grid: &Grid, inputs: &'a Inputs, split: Split, clip: usize) -> Clip<'a> {
    let captions = inputs.text.captions(split, clip);
    let codes = inputs.tokens.clip(split, clip);
    let frames = inputs.tokens.clip_frames(split, clip);
    shown_clip(inputs, codes, frames, grid.lengths(frames).collect(), |own| Clip {
        text: inputs.text.embedding(captions[clip % captions.len()]),
        codes,
        supervised: 0..codes.len(),
        ..own
    })
}
