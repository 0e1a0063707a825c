//! The loss on a split: cross-entropy, and its normalised form.

use std::borrow::Cow;

use super::batch::{Batch, Sequence};
use super::transformer::{Model, end_token};
use crate::codes::TokenStore;
use crate::data::Split;
use crate::generator::SplitLoss;
use crate::generator::passes::passes;
use crate::generator::sums::SplitSums;
use crate::progress::moved;
use crate::text::TextStore;

/// Measures a model, each clip once with one of its captions; clip i shows caption i mod n.
pub fn split_loss(model: &Model, tokens: &TokenStore, text: &TextStore, split: Split) -> SplitLoss {
    let unigram = tokens.stream_log_probs();
    let end = end_token(tokens.n_vocab());
    let mut sums = SplitSums::new(1, tokens.n_clips(split));
    for clips in passes(tokens, split) {
        let streams: Vec<Cow<[u32]>> =
            clips.clone().map(|clip| tokens.stream(split, clip)).collect();
        let to = |clip| tokens.n_targets_of_clip(split, clip);
        let with_text = clips.clone().zip(&streams);
        let sequences: Vec<Sequence> = with_text
            .map(|(clip, codes)| Sequence {
                text: caption(text, split, clip),
                codes,
                from: 0,
                to: to(clip),
            })
            .collect();
        let batch = Batch::pack(&sequences, text.dim(), end);
        let nats = model.nll(&batch);
        let ln_p: Vec<f64> = batch.targets.iter().map(|&id| unigram[id as usize]).collect();
        sums.add(0, (&nats, &ln_p), clips.map(|clip| (clip, to(clip))));
        moved();
    }
    SplitLoss::of(sums, tokens.n_frames(split))
}

/// The caption that a clip shows.
fn caption(text: &TextStore, split: Split, clip: usize) -> &[f32] {
    let captions = text.captions(split, clip);
    text.embedding(captions[clip % captions.len()])
}
