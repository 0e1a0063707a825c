//! The loss on a split: cross-entropy, and its normalised form.

use std::borrow::Cow;

use super::batch::{Batch, Sequence};
use super::transformer::{Model, end_token};
use crate::codes::TokenStore;
use crate::data::Split;
use crate::generator::SplitLoss;
use crate::generator::passes::passes;
use crate::progress::moved;
use crate::text::TextStore;

/// Measures a model, each clip once with one of its captions; clip i shows caption i mod n.
pub fn split_loss(model: &Model, tokens: &TokenStore, text: &TextStore, split: Split) -> SplitLoss {
    let unigram = tokens.stream_log_probs();
    let end = end_token(tokens.n_vocab());
    let (mut nll, mut uni, mut targets) = (0.0, 0.0, 0);
    for clips in passes(tokens, split) {
        let streams: Vec<Cow<[u32]>> =
            clips.clone().map(|clip| tokens.stream(split, clip)).collect();
        let to = |clip| tokens.n_targets_of_clip(split, clip);
        let with_text = clips.zip(&streams);
        let sequences: Vec<Sequence> = with_text
            .map(|(clip, codes)| Sequence {
                text: caption(text, split, clip),
                codes,
                from: 0,
                to: to(clip),
            })
            .collect();
        let batch = Batch::pack(&sequences, text.dim(), end);
        nll += model.nll(&batch).iter().sum::<f64>();
        uni -= batch.targets.iter().map(|&target| unigram[target as usize]).sum::<f64>();
        targets += batch.targets.len();
        moved();
    }
    let frames = tokens.n_frames(split) as f64;
    let n = targets as f64;
    SplitLoss {
        loss_nats: nll / n,
        loss_normalised: (nll - uni) / n,
        nats_per_frame: nll / frames,
        normalised_by_scale: Vec::new(),
        targets,
    }
}

/// The caption that a clip shows.
fn caption(text: &TextStore, split: Split, clip: usize) -> &[f32] {
    let captions = text.captions(split, clip);
    text.embedding(captions[clip % captions.len()])
}
