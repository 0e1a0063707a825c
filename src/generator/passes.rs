//! Which clips are measured together.

use std::ops::Range;

use crate::codes::TokenStore;
use crate::data::Split;
use crate::spec::TARGETS_PER_PASS;

/// Ranges of clips with at most the targets of a pass, or one clip.
pub fn passes(tokens: &TokenStore, split: Split) -> Vec<Range<usize>> {
    let mut passes: Vec<Range<usize>> = Vec::new();
    let mut targets = 0;
    for clip in 0..tokens.n_clips(split) {
        targets += tokens.n_targets_of_clip(split, clip);
        match passes.last_mut() {
            Some(pass) if targets <= TARGETS_PER_PASS => pass.end = clip + 1,
            _ => {
                passes.push(clip..clip + 1);
                targets = tokens.n_targets_of_clip(split, clip);
            }
        }
    }
    passes
}
