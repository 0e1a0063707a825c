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

/// Measures a model, each clip once with one of its captions.
pub fn split_loss(model: &Model, grid: &Grid, inputs: &Inputs, split: Split) -> SplitLoss {
    let mut sums = SplitSums::by_scale(inputs.tokens, split);
    for clips in passes(inputs.tokens, split) {
        let shown: Vec<Clip> = clips.clone().map(|clip| shown(grid, inputs, split, clip)).collect();
        let batch = Batch::pack(&shown, grid, inputs.text.dim(), model.places());
        sums.add_scales(0, (&model.nll(&batch), &batch.targets), &clips);
        moved();
    }
    sums.loss()
}

/// A clip that is shown its own codes, all of them supervised.
fn shown<'a>(grid: &Grid, inputs: &'a Inputs, split: Split, clip: usize) -> Clip<'a> {
    let codes = inputs.tokens.clip(split, clip);
    let frames = inputs.tokens.clip_frames(split, clip);
    shown_clip(inputs, codes, frames, grid.lengths(frames).collect(), |own| Clip {
        text: inputs.text.shown(split, clip),
        codes,
        supervised: 0..codes.len(),
        ..own
    })
}
