//! Options and errors of an import; the motions of files and their rates.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::data::{DataError, FPS};
use crate::failure::FailureKind;
use crate::files::{FileError, read_text};
use crate::motion::JOINT_NAMES;
use crate::motion::retarget::{NameMap, Pose64, Up, resampled};

/// The format of the files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// BVH of any hierarchy that has a body's joints.
    Bvh,
    /// `.npy` of `[T, 22, 3]`, the joints of HumanML3D's skeleton.
    Joints,
    /// `.npy` of `[T, J, 3]` with J ≥ 22, of which the first 22 are SMPL's body.
    SmplxJoints,
    /// KIT-ML: `.npy` of `[T, 21, 3]`, or its features, `[T, 251]`.
    Kit,
}

impl Form {
    pub fn name(self) -> &'static str {
        ["bvh", "joints", "smplx-joints", "kit"][self as usize]
    }

    /// How the names of its files end.
    pub fn ending(self) -> &'static str {
        if self == Form::Bvh { "bvh" } else { "npy" }
    }
}

/// The grouping that splits respect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GroupBy {
    /// Files of one folder.
    Folder,
    /// Files whose names differ in their last number alone.
    Name,
    /// Files whose names agree up to the first `_`.
    Prefix,
    /// Each file by itself.
    File,
}

/// The options of an import.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportOptions {
    pub from: PathBuf,
    pub form: Form,
    /// Names of joints, to override the program's guess.
    pub map: NameMap,
    /// The axis that points up, if given.
    pub up: Option<Up>,
    /// The axes are left-handed.
    pub left_handed: bool,
    /// Frames per second of `.npy` files.
    pub fps: Option<f64>,
    /// Frames per second of the data set.
    pub rate: Rate,
    /// Folder of captions; by default next to the motions.
    pub texts: Option<PathBuf>,
    /// The caption of motions without one, of which not even the name says anything.
    pub caption: String,
    /// By default folders if there are three or more, else names.
    pub group: Option<GroupBy>,
    /// Replace an existing data set.
    pub overwrite: bool,
}

/// Bytes of a mapping file: 22 names. YAML of 64 KiB of brackets takes seconds.
const LONGEST_MAP: usize = 1 << 14;

/// A mapping file: `joint of the skeleton: name of the file's joint`, YAML.
///
/// # Errors
/// The file cannot be read, or names a joint that the skeleton has not.
pub fn read_map(path: &Path) -> Result<NameMap, ImportError> {
    let invalid = |problem: String| ImportError::Map { path: path.to_path_buf(), problem };
    let text = read_text(path).map_err(|error| invalid(error.to_string()))?;
    if text.len() > LONGEST_MAP {
        return Err(invalid(format!("it is longer than {LONGEST_MAP} bytes")));
    }
    let lines: BTreeMap<String, String> =
        serde_yaml::from_str(&text).map_err(|error| invalid(error.to_string()))?;
    let entry = |(role, name): (String, String)| {
        let Some(joint) = JOINT_NAMES.iter().position(|joint| *joint == role) else {
            let joints = JOINT_NAMES.join(", ");
            return Err(invalid(format!("the skeleton has no {role:?}; its joints are {joints}")));
        };
        Ok((joint, name))
    };
    lines.into_iter().map(entry).collect()
}

// The content of files: motions on HumanML3D's skeleton, and their original skeletons.

/// A file's motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// At the rate of the data set, y up, metres.
    pub poses: Vec<Pose64>,
    /// Frames per second of the file.
    pub fps: f64,
    /// Metres of the target per unit of the file, if it was changed.
    pub unit_m: Option<f64>,
    /// A sentence on how the file was read, where that may be wrong.
    pub remark: Option<String>,
}

/// The motions of files, in their order, each or a sentence.
pub struct Motions {
    pub motions: Vec<Result<Motion, String>>,
    pub skeletons: Vec<Skeleton>,
    /// A mapping file to fill in, where a skeleton's joints are not all known.
    pub draft: Option<String>,
}

/// The interpretation of a skeleton of the files.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Skeleton {
    /// Names of its joints, in the order of the file.
    #[serde(skip)]
    pub joints: Vec<String>,
    /// Files that have it.
    pub files: usize,
    pub up: String,
    /// The source of its neutral pose.
    pub neutral: String,
    /// Joints that play the parts of the 22, as `pelvis: Hips`.
    #[serde(rename = "joints")]
    pub roles: BTreeMap<&'static str, String>,
}

/// Frames per second of the data set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rate {
    /// Every motion is resampled to it.
    Fixed(f64),
    /// That of the files, which must be one.
    Kept,
}

impl Rate {
    /// Poses of a file of `fps` frames per second, at the rate of the data set.
    pub(super) fn of(self, poses: &[Pose64], fps: f64) -> Vec<Pose64> {
        match self {
            Rate::Fixed(rate) => resampled(poses, fps, rate),
            Rate::Kept => poses.to_vec(),
        }
    }

    /// Frames per second of the data set of these motions.
    ///
    /// # Errors
    /// They differ, but should be kept.
    pub(super) fn of_all(self, motions: &[Result<Motion, String>]) -> Result<f64, ImportError> {
        let mut rates = motions.iter().flatten().map(|motion| motion.fps);
        match (self, rates.next()) {
            (Rate::Fixed(rate), _) => Ok(rate),
            (Rate::Kept, None) => Ok(FPS),
            (Rate::Kept, Some(first)) => match rates.find(|other| *other != first) {
                None => Ok(first),
                Some(other) => Err(ImportError::Rates { first, other }),
            },
        }
    }
}

/// Why nothing is imported.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    #[error("{} holds no .{ending} file", path.display())]
    NoFiles { path: PathBuf, ending: &'static str },
    #[error("{} is there already; give another --out, or --overwrite", path.display())]
    Exists { path: PathBuf },
    #[error("{} is no data set that was imported, and is not written over", path.display())]
    NotImported { path: PathBuf },
    #[error("{}: {problem}", path.display())]
    Map { path: PathBuf, problem: String },
    #[error("no file can be used:\n  {}", first(problems))]
    NothingUsable { problems: Vec<String>, draft: Option<String> },
    #[error(
        "{found} cannot be parted into train, val and test; add motions, or give another --group: folder, \
         name, prefix or file"
    )]
    TooFewGroups { found: String },
    #[error(".npy files do not say how many frames a second they have; give --fps")]
    Fps,
    #[error(
        "there are motions of {first} and of {other} frames a second, and a data set has one rate: give \
         --rate, as --rate {first}"
    )]
    Rates { first: f64, other: f64 },
    #[error(transparent)]
    Data(#[from] DataError),
    #[error(transparent)]
    File(#[from] FileError),
}

impl ImportError {
    /// The failure of a job that ends with it.
    pub fn failure_kind(&self) -> FailureKind {
        match self {
            Self::Data(error) => error.failure_kind(),
            Self::File(error) => error.failure_kind(),
            _ => FailureKind::BadData,
        }
    }
}

/// Most problems that are shown.
const TOLD: usize = 12;

fn first(problems: &[String]) -> String {
    let mut told: Vec<String> = problems.iter().take(TOLD).cloned().collect();
    if problems.len() > TOLD {
        told.push(format!("and {} more", problems.len() - TOLD));
    }
    told.join("\n  ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_one_rate_keep_it_and_others_are_refused() {
        let motion = |fps| Ok(Motion { poses: Vec::new(), fps, unit_m: None, remark: None });
        let broken = || Err("is broken".to_string());
        assert_eq!(Rate::Kept.of_all(&[broken(), motion(30.0), motion(30.0)]).unwrap(), 30.0);
        assert_eq!(Rate::Fixed(25.0).of_all(&[motion(30.0), motion(60.0)]).unwrap(), 25.0);
        let error = Rate::Kept.of_all(&[motion(30.0), motion(60.0)]).unwrap_err().to_string();
        assert!(error.contains("30 and of 60 frames a second"), "{error}");
    }
}
