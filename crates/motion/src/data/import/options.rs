//! What is imported, and how.

use std::path::{Path, PathBuf};

use super::error::ImportError;
use super::rate::Rate;
use crate::motion::JOINT_NAMES;
use crate::motion::retarget::{NameMap, Up};

/// What the files hold.
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

/// What no split parts.
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

/// What is imported, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportOptions {
    pub from: PathBuf,
    pub form: Form,
    /// Names of joints, where the program's guess is not used.
    pub map: NameMap,
    /// The axis that points up, where it is not looked for.
    pub up: Option<Up>,
    /// The axes are left-handed.
    pub left_handed: bool,
    /// Frames a second of `.npy` files.
    pub fps: Option<f64>,
    /// Frames a second of the data set.
    pub rate: Rate,
    /// Folder of captions; by default they lie beside the motions.
    pub texts: Option<PathBuf>,
    /// The caption of motions without one, of which not even the name says anything.
    pub caption: String,
    /// By default folders where there are three or more, or else names.
    pub group: Option<GroupBy>,
    /// Replace a data set that stands there.
    pub overwrite: bool,
}

/// A mapping file: `joint of the skeleton: name of the file's joint`, YAML.
///
/// # Errors
/// The file cannot be read, or names a joint that the skeleton has not.
pub fn read_map(path: &Path) -> Result<NameMap, ImportError> {
    let invalid = |problem: String| ImportError::Map { path: path.to_path_buf(), problem };
    let text = crate::files::read_text(path).map_err(|error| invalid(error.to_string()))?;
    let lines: std::collections::BTreeMap<String, String> =
        serde_yaml::from_str(&text).map_err(|error| invalid(error.to_string()))?;
    let entry = |(role, name): (String, String)| {
        let joint = JOINT_NAMES.iter().position(|joint| *joint == role);
        let joint = joint.ok_or_else(|| {
            invalid(format!(
                "the skeleton has no {role:?}; its joints are {}",
                JOINT_NAMES.join(", ")
            ))
        })?;
        Ok((joint, name))
    };
    lines.into_iter().map(entry).collect()
}
