//! The order of codes: scale after scale within a clip, or clip after clip within a scale.

/// Clips of one length, whose latents are quantized together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    pub n_clips: usize,
    /// Latents of each clip.
    pub n_latents: usize,
}

/// Codes clip after clip, those of a clip scale after scale, from those of each scale, clip after clip.
pub fn by_clip(scales: &[Vec<u32>], n_clips: usize) -> Vec<u32> {
    let mut ids = Vec::with_capacity(scales.iter().map(Vec::len).sum());
    for clip in 0..n_clips {
        for own in scales {
            let length = own.len() / n_clips;
            ids.extend_from_slice(&own[clip * length..][..length]);
        }
    }
    ids
}

/// The inverse of [`by_clip`] for clips that have `lengths` codes on their scales, or the codes of
/// their first scales alone: as many scales come back as there are codes of.
///
/// # Panics
/// If the codes are those of no whole number of scales.
pub fn by_scale(ids: &[u32], lengths: &[usize], n_clips: usize) -> Vec<Vec<u32>> {
    let per_clip = ids.len() / n_clips;
    let mut scales = Vec::new();
    let mut from = 0;
    for length in lengths {
        if from + length > per_clip {
            break;
        }
        let own = ids.chunks_exact(per_clip).flat_map(|clip| &clip[from..from + length]);
        scales.push(own.copied().collect());
        from += length;
    }
    assert_eq!(from * n_clips, ids.len(), "codes of {n_clips} clips with {lengths:?} codes each");
    scales
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_come_back_by_scale_all_of_them_and_the_first() {
        let scales = vec![vec![1, 2], vec![3, 4, 5, 6]];
        let ids = by_clip(&scales, 2);
        assert_eq!(ids, [1, 3, 4, 2, 5, 6]);
        assert_eq!(by_scale(&ids, &[1, 2], 2), scales);
        assert_eq!(by_scale(&[7, 8], &[1, 2], 2), [[7, 8]]);
    }
}
