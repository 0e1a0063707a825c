//! The loss on a split: cross-entropy, and its normalised form.

use super::batch::{Batch, Sequence};
use super::transformer::{Model, end_token};
use crate::codes::TokenStore;
use crate::data::Split;
use crate::generator::SplitLoss;
use crate::progress::moved;
use crate::spec::TARGETS_PER_PASS;
use crate::text::TextStore;

/// Measures a model, each clip once with one of its captions; clip i shows caption i mod n.
pub fn split_loss(model: &Model, tokens: &TokenStore, text: &TextStore, split: Split) -> SplitLoss {
    let unigram = tokens.unigram_log_probs(0);
    let end = end_token(tokens.n_vocab());
    let (mut nll, mut uni, mut targets) = (0.0, 0.0, 0);
    for clips in passes(tokens, split) {
        let sequences: Vec<Sequence> =
            clips.map(|clip| sequence(tokens, text, split, clip)).collect();
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
        targets,
    }
}

fn sequence<'a>(
    tokens: &'a TokenStore,
    text: &'a TextStore,
    split: Split,
    clip: usize,
) -> Sequence<'a> {
    let captions = text.captions(split, clip);
    let codes = tokens.clip(split, clip);
    let text = text.embedding(captions[clip % captions.len()]);
    Sequence { text, codes, from: 0, to: codes.len() + 1 }
}

/// Ranges of clips with at most the targets of a pass, or one clip.
fn passes(tokens: &TokenStore, split: Split) -> Vec<std::ops::Range<usize>> {
    let mut passes = Vec::new();
    let (mut start, mut targets) = (0, 0);
    for clip in 0..tokens.n_clips(split) {
        let more = tokens.clip(split, clip).len() + 1;
        if targets + more > TARGETS_PER_PASS && targets > 0 {
            passes.push(start..clip);
            (start, targets) = (clip, 0);
        }
        targets += more;
    }
    passes.push(start..tokens.n_clips(split));
    passes
}
