//! [`Rate`]: how many frames a second a data set has.

use super::error::ImportError;
use super::motions::Motion;
use crate::motion::retarget::{Pose64, resampled};

/// Frames a second of the data set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rate {
    /// Every motion is resampled to it.
    Fixed(f64),
    /// That of the files, which must be one.
    Kept,
}

impl Rate {
    /// Poses of a file of `fps` frames a second, at the rate of the data set.
    pub(super) fn of(self, poses: &[Pose64], fps: f64) -> Vec<Pose64> {
        match self {
            Rate::Fixed(rate) => resampled(poses, fps, rate),
            Rate::Kept => poses.to_vec(),
        }
    }

    /// Frames a second of the data set of these motions.
    ///
    /// # Errors
    /// They differ, and should be kept.
    pub(super) fn of_all(self, motions: &[Result<Motion, String>]) -> Result<f64, ImportError> {
        let mut rates = motions.iter().flatten().map(|motion| motion.fps);
        match (self, rates.next()) {
            (Rate::Fixed(rate), _) => Ok(rate),
            (Rate::Kept, None) => Ok(crate::data::FPS),
            (Rate::Kept, Some(first)) => match rates.find(|other| *other != first) {
                None => Ok(first),
                Some(other) => Err(ImportError::Rates { first, other }),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_one_rate_keep_it_and_others_are_refused() {
        let motion = |fps| Ok(Motion { poses: Vec::new(), fps, unit_m: None });
        let broken = || Err("is broken".to_string());
        assert_eq!(Rate::Kept.of_all(&[broken(), motion(30.0), motion(30.0)]).unwrap(), 30.0);
        assert_eq!(Rate::Fixed(25.0).of_all(&[motion(30.0), motion(60.0)]).unwrap(), 25.0);
        let error = Rate::Kept.of_all(&[motion(30.0), motion(60.0)]).unwrap_err().to_string();
        assert!(error.contains("30 and of 60 frames a second"), "{error}");
    }
}
