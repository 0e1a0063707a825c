//! [`Windows`]: what a training step sees.

/// Windows of one length.
#[derive(Clone, Debug, PartialEq)]
pub struct Windows {
    /// Normalised, row-major `[n, n_frames, f]`; where a clip has ended, its last frame again.
    pub values: Vec<f32>,
    /// Whether a frame is one of the clip's own, `[n, n_frames]`.
    pub visible: Vec<bool>,
    pub n_frames: usize,
    /// The clip of the training split that each window was cut from, or whose mirror image was.
    pub clips: Vec<usize>,
}

impl Windows {
    /// The number of windows.
    pub fn len(&self) -> usize {
        self.visible.len() / self.n_frames
    }

    /// Frames that are a clip's own.
    pub fn n_visible(&self) -> usize {
        self.visible.iter().filter(|visible| **visible).count()
    }
}
