//! The loss on a split, by scale and as a whole.

use super::batch::{Batch, Clip};
use super::model::Model;
use super::shown::shown_clip;
use crate::codes::Grid;
use crate::data::Split;
use crate::generator::passes::passes;
use crate::generator::sums::Sums;
use crate::generator::{Inputs, SplitLoss};
use crate::progress::moved;

/// Measures a model, each clip once with one of its captions; clip i shows caption i mod n.
pub fn split_loss(model: &Model, grid: &Grid, inputs: &Inputs, split: Split) -> SplitLoss {
    let tokens = inputs.tokens;
    let unigrams: Vec<Vec<f64>> =
        (0..grid.scales.len()).map(|scale| tokens.unigram_log_probs(scale)).collect();
    let mut sums = vec![Sums::default(); grid.scales.len()];
    for clips in passes(tokens, split) {
        let clips: Vec<Clip> = clips.map(|clip| shown(grid, inputs, split, clip)).collect();
        let batch = Batch::pack(&clips, grid, inputs.text.dim(), model.places());
        let nll = model.nll(&batch);
        for (scale, (sums, nll)) in sums.iter_mut().zip(nll).enumerate() {
            let codes = &batch.targets[scale].codes;
            sums.nll += nll.iter().sum::<f64>();
            sums.unigram -= codes.iter().map(|&code| unigrams[scale][code as usize]).sum::<f64>();
            sums.n += codes.len();
        }
        moved();
    }
    Sums::split_loss(&sums, tokens.n_frames(split))
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
