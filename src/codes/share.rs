//! Which clips of the training split belong to a share of it.

use std::cmp::Reverse;

use super::TokenStore;
use crate::data::Split;
use crate::spec::Share;

/// Clips that are in a share together: a clip and its mirror image stand side by side, and so do the parts
/// of a recording, so that a share is less motion and not the same motion in fewer pieces.
const TOGETHER: usize = 8;

impl TokenStore {
    /// The clips of a share of the training split, in their order.
    ///
    /// A smaller share is a part of a larger one, and every seed has the same.
    pub fn training_clips(&self, share: Share) -> Vec<usize> {
        let n_clips = self.n_clips(Split::Train);
        let mut blocks: Vec<usize> = (0..n_clips.div_ceil(TOGETHER)).collect();
        if !share.is_whole() {
            let drawn = |block: &usize| Reverse(*blake3::hash(&block.to_le_bytes()).as_bytes());
            blocks.sort_by_key(drawn);
            blocks.truncate(share.of(blocks.len()));
            blocks.sort_unstable();
        }
        let clips = |block| block * TOGETHER..n_clips.min((block + 1) * TOGETHER);
        blocks.into_iter().flat_map(clips).collect()
    }

    /// What a generator predicts of a share of the training split, end tokens included.
    pub fn training_targets(&self, share: Share) -> usize {
        let clips = self.training_clips(share).into_iter();
        clips.map(|clip| self.n_targets_of_clip(Split::Train, clip)).sum()
    }
}
