//! Which clips of the training split belong to a share of it.

use super::TokenStore;
use crate::data::Split;
use crate::spec::Share;

impl TokenStore {
    /// The clips of a share of the training split, in their order.
    ///
    /// Each clip is drawn by itself, so that what a run meets in its first pass over a share is as various as
    /// what it would meet of the whole split: shares then differ in repetition alone. A smaller share is a
    /// part of a larger one, and every seed has the same.
    pub fn training_clips(&self, share: Share) -> Vec<usize> {
        let mut clips: Vec<usize> = (0..self.n_clips(Split::Train)).collect();
        if !share.is_whole() {
            clips.sort_by_cached_key(|clip| *blake3::hash(&clip.to_le_bytes()).as_bytes());
            clips.truncate(share.of(clips.len()));
            clips.sort_unstable();
        }
        clips
    }

    /// What a generator predicts of a share of the training split, end tokens included.
    pub fn training_targets(&self, share: Share) -> usize {
        let clips = self.training_clips(share).into_iter();
        clips.map(|clip| self.n_targets_of_clip(Split::Train, clip)).sum()
    }
}
