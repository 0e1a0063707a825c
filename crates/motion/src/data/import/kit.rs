//! KIT-ML's 21 joints (Plappert et al. 2016), in the order of text-to-motion, as the 22 of HumanML3D.
//!
//! Pelvis, belly, chest, lower and upper neck; shoulder, elbow and wrist of one side and of the other; hip, knee,
//! ankle, ball of the foot and toes likewise. Millimetres, 12.5 frames a second.

use crate::motion::retarget::Pose64;
use crate::motion::vector::{Point, add, scale, sub};
use crate::motion::{N_JOINTS, feature_width, recover_body};

/// Joints of KIT-ML's body.
pub const JOINTS: usize = 21;
/// Features of a frame, where a file holds those.
pub const FEATURES: usize = feature_width(JOINTS);
/// Frames a second of KIT-ML's files.
pub const FPS: f64 = 12.5;

/// Which side the joints 5 to 7 and 11 to 15 are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum First {
    /// As text-to-motion reads them.
    Right,
    /// As the order of their names has them.
    Left,
}

/// How far from the neck to the shoulder, and to the chest, a collar of HumanML3D's is: by least squares over
/// moving bodies, 6 mm off an axis.
const COLLAR: [f64; 2] = [0.37, 0.28];
/// How far from the first joint of the spine to the third the second is, likewise.
const SPINE: f64 = 0.73;

/// The joints that rows of [`FEATURES`] describe, from the origin on.
pub fn bodies(features: &[f32]) -> Vec<[Point; JOINTS]> {
    let body = |body: [[f32; 3]; JOINTS]| body.map(|place| place.map(f64::from));
    recover_body(features).into_iter().map(body).collect()
}

/// A pose of KIT-ML as one of HumanML3D's joints. Joints that it has not lie between those that it has.
pub fn pose(joints: &[Point; JOINTS], first: First) -> Pose64 {
    let [chest, neck] = [joints[2], joints[3]];
    let between = |a: Point, share: f64, b: Point| add(a, scale(sub(b, a), share));
    let mut pose = [[0.0; 3]; N_JOINTS];
    let trunk = [(0, joints[0]), (3, joints[1]), (6, between(joints[1], SPINE, chest)), (9, chest)];
    trunk.into_iter().chain([(12, neck), (15, joints[4])]).for_each(|(i, place)| pose[i] = place);
    // Of HumanML3D's joints those of the left come first.
    let sides = if first == First::Left { [0, 1] } else { [1, 0] };
    for (kit, side) in sides.into_iter().enumerate() {
        let (arm, leg) = (&joints[5 + 3 * kit..], &joints[11 + 5 * kit..]);
        let [out, down] = COLLAR;
        let low = between(neck, down, chest);
        pose[13 + side] = add(low, scale(sub(arm[0], neck), out));
        (0..3).for_each(|i| pose[16 + 2 * i + side] = arm[i]);
        (0..4).for_each(|i| pose[1 + 3 * i + side] = leg[i]);
    }
    pose
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::JOINT_NAMES;

    #[test]
    fn every_joint_has_its_place() {
        // Joint i of KIT-ML lies at x = i.
        let joints: [Point; JOINTS] = std::array::from_fn(|i| [i as f64, 0.0, 0.0]);
        let named = |first| {
            let pose = pose(&joints, first);
            JOINT_NAMES.into_iter().zip(pose.map(|place| place[0])).collect::<Vec<_>>()
        };
        let right = named(First::Right);
        let at = |name: &str| right.iter().find(|(own, _)| *own == name).unwrap().1;
        assert_eq!(["right_wrist", "left_wrist", "head"].map(at), [7.0, 10.0, 4.0]);
        assert_eq!(["right_hip", "right_ankle", "right_foot"].map(at), [11.0, 13.0, 14.0]);
        assert_eq!(["left_hip", "left_knee", "spine2"].map(at), [16.0, 17.0, 1.73]);
        let left = named(First::Left);
        assert!(left.contains(&("left_wrist", 7.0)) && left.contains(&("right_foot", 19.0)));
    }
}
