//! The loss on a split, by scale and as a whole.

use super::batch::{Batch, Clip};
use super::model::Model;
use crate::data::Split;
use crate::generator::passes::passes;
use crate::generator::sums::SplitSums;
use crate::generator::{Inputs, SplitLoss};
use crate::progress::moved;

/// Measures a model, each clip once with one of its captions, shown its own codes.
pub fn split_loss(model: &Model, inputs: &Inputs, split: Split) -> SplitLoss {
    let (tokens, text) = (inputs.tokens, inputs.text);
    let mut sums = SplitSums::by_scale(tokens, split);
    for clips in passes(tokens, split) {
        let shown = clips.clone().map(|clip| {
            let supervised = 0..tokens.clip(split, clip).len();
            let about = (text.shown(split, clip), supervised);
            Clip::of((inputs, tokens.grid()), (split, clip), about, |codes, _| codes.to_vec())
        });
        let shown: Vec<Clip> = shown.collect();
        let batch = Batch::pack(&shown, tokens.grid(), text.dim(), model.places());
        sums.add_scales(0, (&model.nll(&batch), &batch.targets), &clips);
        moved();
    }
    sums.loss()
}
