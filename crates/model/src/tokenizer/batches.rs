//! Batches of clips of one length, so that no clip is padded and none changes another's codes.

use super::error::TokenizerError;
use crate::data::{DataError, MotionSource, Split};

/// Frames of a batch, unless a single clip has more.
const FRAMES_AT_ONCE: usize = 2048;

/// Clips of a split that are encoded together.
#[derive(Debug, PartialEq, Eq)]
pub struct ClipBatch {
    /// Clips by their index in the split.
    pub indices: Vec<usize>,
    /// Frames that are used of each: whole tokens.
    pub n_frames: usize,
}

/// All clips of a split, cut to tokens of `stride` frames.
///
/// # Errors
/// If a clip is shorter than a token.
pub fn equal_length_batches(
    source: &dyn MotionSource,
    split: Split,
    stride: usize,
) -> Result<Vec<ClipBatch>, TokenizerError> {
    let clips = (0..source.n_clips(split)).map(|index| whole_tokens(source, split, index, stride));
    let mut clips = clips.collect::<Result<Vec<_>, _>>()?;
    clips.sort_unstable();
    let runs = clips.chunk_by(|a, b| a.0 == b.0);
    let parts = runs.flat_map(|run| run.chunks((FRAMES_AT_ONCE / run[0].0).max(1)));
    let batch = |part: &[(usize, usize)]| ClipBatch {
        indices: part.iter().map(|&(_, index)| index).collect(),
        n_frames: part[0].0,
    };
    Ok(parts.map(batch).collect())
}

/// The frames to use of a clip, and its index.
fn whole_tokens(
    source: &dyn MotionSource,
    split: Split,
    index: usize,
    stride: usize,
) -> Result<(usize, usize), TokenizerError> {
    let n_frames = source.n_frames(split, index);
    if n_frames < stride {
        let clip = source.clip_id(split, index);
        let split = split.name();
        return Err(TokenizerError::ShortClip { clip, split, n_frames, stride });
    }
    Ok((n_frames - n_frames % stride, index))
}

impl ClipBatch {
    /// Raw features, clip after clip, row-major `[n_clips, n_frames, n_features]`.
    pub fn features(&self, source: &dyn MotionSource, split: Split) -> Result<Vec<f32>, DataError> {
        let size = self.n_frames * source.stats().mean.len();
        let mut stack = Vec::with_capacity(self.indices.len() * size);
        for &index in &self.indices {
            stack.extend_from_slice(&source.features(split, index)?[..size]);
        }
        Ok(stack)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tokenizer::testing::Waves;

    #[test]
    fn clips_of_one_length_share_batches_up_to_the_limit() {
        let source = Waves::new(&[40, 44, 1000, 40, 1000, 41, 1000], 1);
        let batches = equal_length_batches(&source, Split::Test, 4).unwrap();
        let batch = |indices: &[usize], n_frames| ClipBatch { indices: indices.into(), n_frames };
        let expected =
            [batch(&[0, 3, 5], 40), batch(&[1], 44), batch(&[2, 4], 1000), batch(&[6], 1000)];
        assert_eq!(batches, expected);
    }

    #[test]
    fn a_clip_shorter_than_a_token_is_named() {
        let source = Waves::new(&[40, 12], 1);
        let error = equal_length_batches(&source, Split::Val, 16).unwrap_err().to_string();
        assert!(error.contains("clip val-1") && error.contains("12 frames"), "{error}");
    }
}
