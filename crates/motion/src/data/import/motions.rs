//! What files hold: motions on HumanML3D's skeleton, and the skeletons that they come from.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::motion::retarget::Pose64;

/// A file's motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// At the rate of the data set, y up, metres.
    pub poses: Vec<Pose64>,
    /// Frames a second of the file.
    pub fps: f64,
    /// Metres of the target in one of the file's units, where it was changed.
    pub unit_m: Option<f64>,
}

/// The motions of files, in their order, each or a sentence.
pub struct Motions {
    pub motions: Vec<Result<Motion, String>>,
    pub skeletons: Vec<Skeleton>,
    /// A mapping file to fill in, where a skeleton's joints are not all known.
    pub draft: Option<String>,
}

/// What a skeleton of the files is taken for.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Skeleton {
    /// Names of its joints, in the order of the file.
    #[serde(skip)]
    pub joints: Vec<String>,
    /// Files that have it.
    pub files: usize,
    pub up: String,
    /// Where its neutral pose comes from.
    pub neutral: String,
    /// Joints that play the parts of the 22, as `pelvis: Hips`.
    #[serde(rename = "joints")]
    pub roles: BTreeMap<&'static str, String>,
}
