//! A motion for people and programs: arrays, BVH, an animated SVG, and a sheet of many.
//!
//! `features → joints (recovery) → BVH (own inverse kinematics), SVG (camera, ground, body)`.
//!
//! | layer | files |
//! | --- | --- |
//! | what is seen | `camera`, `body`, `ground` |
//! | pages | `page` with `animation` (SVG), `sheet` (PNG), `caption`, `legend` |
//!
//! The same motion gives the same bytes. `docs/motion-files.md` tells readers of the files.

mod animation;
mod body;
mod camera;
mod caption;
mod ground;
mod legend;
mod page;
mod sheet;

#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use thiserror::Error;

use super::render::DrawError;
use crate::data::write_npy;
use crate::files::{FileError, atomic};
use crate::motion::bvh::{Deviation, FitBvhError, fit_bvh};
use crate::motion::{N_FEATURES, N_JOINTS, Pose, recover_joints};

/// A motion as a model makes it.
#[derive(Clone, Copy, Debug)]
pub struct CaptionedMotion<'a> {
    /// Row-major `[T, 263]`, not normalised.
    pub features: &'a [f32],
    /// Frames a second.
    pub fps: f32,
    pub caption: &'a str,
}

/// The files of a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct WrittenMotion {
    /// `[T, 22, 3]`, metres, y up.
    pub joints: PathBuf,
    /// `[T, 263]`, as given.
    pub features: PathBuf,
    pub bvh: PathBuf,
    pub svg: PathBuf,
    /// How far the rigid body of the BVH is from the joints.
    pub deviation: Deviation,
}

/// Why a motion cannot be written.
#[derive(Debug, Error)]
pub enum MotionFileError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{found} numbers are no rows of {N_FEATURES} features; give whole frames")]
    Features { found: usize },
    #[error("feature {column} of frame {frame} is not finite; the motion cannot be shown")]
    NotFinite { frame: usize, column: usize },
    #[error(transparent)]
    Motion(#[from] FitBvhError),
    #[error("a sheet without motions is empty; give at least one")]
    NoMotions,
    #[error("cannot draw {}: {error}", path.display())]
    Draw { path: PathBuf, error: DrawError },
}

/// Writes `<stem>.joints.npy`, `<stem>.features.npy`, `<stem>.bvh` and `<stem>.svg` into `folder`.
///
/// The folder is made where it is missing; each file appears whole, by rename. Nothing is written
/// of a motion that is refused.
///
/// # Errors
/// [`MotionFileError`], where the features are no motion or a file cannot be written.
pub fn write_motion(
    folder: &Path,
    stem: &str,
    motion: &CaptionedMotion,
) -> Result<WrittenMotion, MotionFileError> {
    let file = |ending: &str| folder.join(format!("{stem}.{ending}"));
    let (joints, features, bvh, svg) =
        (file("joints.npy"), file("features.npy"), file("bvh"), file("svg"));
    let poses = motion.poses()?;
    let fitted = fit_bvh(&poses, motion.fps)?;
    let page = page::svg(&poses, motion.fps, motion.caption);
    let n_frames = poses.len();
    write_npy(&joints, &[n_frames, N_JOINTS, 3], poses.as_flattened().as_flattened())?;
    write_npy(&features, &[n_frames, N_FEATURES], motion.features)?;
    atomic::write_bytes(&bvh, fitted.bvh.to_string().as_bytes())?;
    atomic::write_bytes(&svg, page.as_bytes())?;
    Ok(WrittenMotion { joints, features, bvh, svg, deviation: fitted.deviation })
}

/// Writes a PNG with a row for each motion: its caption, and eight poses at even times.
///
/// All bodies are seen by one camera and drawn to one scale, each with its root in the middle.
///
/// # Errors
/// [`MotionFileError`], where there is no motion, one is none, or the file cannot be written.
pub fn write_sheet<'a>(
    path: &Path,
    motions: &[CaptionedMotion<'a>],
) -> Result<(), MotionFileError> {
    if motions.is_empty() {
        return Err(MotionFileError::NoMotions);
    }
    let row = |motion: &CaptionedMotion<'a>| -> Result<sheet::Row<'a>, MotionFileError> {
        Ok(sheet::Row { poses: motion.poses()?, fps: motion.fps, caption: motion.caption })
    };
    let rows: Vec<sheet::Row> = motions.iter().map(row).collect::<Result<_, _>>()?;
    let failed = |error| MotionFileError::Draw { path: path.to_path_buf(), error };
    let pixels = sheet::png(&rows).map_err(failed)?;
    Ok(atomic::write_bytes(path, &pixels)?)
}

impl CaptionedMotion<'_> {
    /// The joints, of features that can be shown.
    fn poses(&self) -> Result<Vec<Pose>, MotionFileError> {
        let found = self.features.len();
        if !found.is_multiple_of(N_FEATURES) {
            return Err(MotionFileError::Features { found });
        }
        if found == 0 {
            return Err(FitBvhError::NoFrames.into());
        }
        if !(self.fps.is_finite() && self.fps > 0.0) {
            return Err(FitBvhError::Fps { fps: self.fps }.into());
        }
        match self.features.iter().position(|value| !value.is_finite()) {
            Some(at) => {
                Err(MotionFileError::NotFinite { frame: at / N_FEATURES, column: at % N_FEATURES })
            }
            None => Ok(recover_joints(self.features)),
        }
    }
}
