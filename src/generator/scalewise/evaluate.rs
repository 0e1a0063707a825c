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
    let mut sums = Vec::with_capacity(tokens.n_clips(split));
    for clips in passes(tokens, split) {
        let shown: Vec<Clip> = clips.clone().map(|clip| shown(grid, inputs, split, clip)).collect();
        let batch = Batch::pack(&shown, grid, inputs.text.dim(), model.places());
        let mut nats: Vec<_> = model.nll(&batch).into_iter().map(Vec::into_iter).collect();
        for clip in clips {
            let scales = nats.iter_mut().zip(&unigrams).enumerate();
            let of_scale = scales.map(|(scale, (nats, unigram))| {
                let codes = tokens.scale(split, clip, scale);
                let ln_p = codes.iter().map(|&code| unigram[code as usize]);
                Sums::of(nats.by_ref().take(codes.len()), ln_p)
            });
            sums.push(of_scale.collect());
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
