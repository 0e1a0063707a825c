//! The loss on a split: cross-entropy, and its normalised form.

use std::borrow::Cow;

use super::batch::{Batch, Sequence};
use super::transformer::{Model, end_token};
use crate::data::Split;
use crate::generator::passes::passes;
use crate::generator::sums::SplitSums;
use crate::generator::{Inputs, SplitLoss};
use crate::progress::moved;

/// Measures a model, each clip once with one of its captions.
pub fn split_loss(model: &Model, inputs: &Inputs, split: Split) -> SplitLoss {
    let Inputs { tokens, text, .. } = *inputs;
    let mut sums = SplitSums::new(tokens, split, vec![tokens.stream_log_probs()]);
    for clips in passes(tokens, split) {
        let streams: Vec<Cow<[u32]>> =
            clips.clone().map(|clip| tokens.stream(split, clip)).collect();
        let to = |clip| tokens.n_targets_of_clip(split, clip);
        let sequences = clips.clone().zip(&streams).map(|(clip, codes)| Sequence {
            text: text.shown(split, clip),
            codes,
            from: 0,
            to: to(clip),
        });
        let sequences: Vec<Sequence> = sequences.collect();
        let batch = Batch::pack(&sequences, text.dim(), end_token(tokens.n_vocab()));
        let nats = model.nll(&batch);
        sums.add(0, (&nats, &batch.targets), clips.map(|clip| (clip, to(clip))));
        moved();
    }
    sums.loss()
}
