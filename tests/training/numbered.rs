//! A corpus in which a target tells where it is from.

use super::corpus::{Clips, Corpus};

/// Eight clips in which every code stands once, so that a target tells where it is from.
pub fn numbered_corpus() -> Corpus {
    let mut next = 0..;
    let lengths = [5, 1, 8, 2, 11, 3, 3, 7];
    let clips: Clips = lengths.map(|n| next.by_ref().take(n).collect()).into();
    let captions = |clip| (0..=clip % 4).map(|i| format!("{clip} {}", "on ".repeat(i))).collect();
    Corpus::new(40, [clips.clone(), clips.clone(), clips], captions)
}

/// Supervised tokens of an epoch over it: codes and end tokens.
pub const EPOCH_TOKENS: usize = 40 + 8;
