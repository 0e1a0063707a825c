//! Poses and bones of the skeleton that motion is brought to.

use crate::motion::vector::{Point, add, sub, with_length};
use crate::motion::{BONE_LENGTHS, N_JOINTS, PARENTS};

/// A pose in double precision.
pub type Pose64 = [Point; N_JOINTS];

/// Length of the target's leg, hip to knee to ankle, the mean of both sides; metres.
pub fn leg() -> f64 {
    [4, 5, 7, 8].iter().map(|&joint| f64::from(BONE_LENGTHS[joint])).sum::<f64>() / 2.0
}

/// The pose with every bone as long as the target's, each in its direction.
pub fn with_lengths(pose: &Pose64) -> Pose64 {
    let mut found = *pose;
    for joint in 1..N_JOINTS {
        let parent = PARENTS[joint].unwrap_or(0);
        let bone = with_length(sub(pose[joint], pose[parent]), f64::from(BONE_LENGTHS[joint]));
        found[joint] = add(found[parent], bone.unwrap_or_default());
    }
    found
}
