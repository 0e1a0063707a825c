//! Text into a [`Bvh`].

mod frames;
mod joints;
mod words;

use super::error::BvhError;
use super::hierarchy::Bvh;

impl Bvh {
    /// The file that `text` is.
    ///
    /// Any hierarchy is read: several roots, joints with any channels in any order or with none,
    /// several End Sites, names of several words, keywords in any case. A frame is a line.
    ///
    /// # Errors
    /// [`BvhError`] names the line and what is expected there.
    pub fn parse(text: &str) -> Result<Bvh, BvhError> {
        let text = text.trim_start_matches('\u{feff}');
        let lines: Vec<&str> = text.lines().collect();
        let is_motion = |line: &&str| line.trim().eq_ignore_ascii_case("MOTION");
        let Some(motion) = lines.iter().position(is_motion) else {
            return Err(BvhError::end(lines.len(), "the line MOTION"));
        };
        let joints = joints::parse(&lines[..motion])?;
        let n_channels = joints.iter().map(|joint| joint.channels.len()).sum();
        let (frame_time_s, frames) = frames::parse(&lines, motion + 1, n_channels)?;
        Ok(Bvh { joints, frame_time_s, frames })
    }
}
