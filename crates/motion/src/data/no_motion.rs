//! [`NoMotion`]: stands where a sweep names no data, since its trainer brings its own.

use super::source::{DataError, Metadata, MotionSource, Split};

/// A source without a clip.
pub struct NoMotion(Metadata);

impl Default for NoMotion {
    /// At HumanML3D's frames a second, for losses a second.
    fn default() -> Self {
        Self(Metadata { fps: 20.0, digest: "none".to_string(), ..Metadata::default() })
    }
}

impl MotionSource for NoMotion {
    fn n_clips(&self, _: Split) -> usize {
        0
    }

    fn n_frames(&self, _: Split, _: usize) -> usize {
        0
    }

    fn captions(&self, _: Split, _: usize) -> Vec<String> {
        Vec::new()
    }

    fn features(&self, split: Split, index: usize) -> Result<Vec<f32>, DataError> {
        let problem = "the sweep has no motion (`source: none`)";
        Err(DataError::invalid(self.clip_id(split, index), problem))
    }

    fn metadata(&self) -> &Metadata {
        &self.0
    }
}
