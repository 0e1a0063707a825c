//! The 22-joint skeleton of HumanML3D, SMPL's body without its hands, and the distance between its motions.

use super::geometry::{Yaw, norm, sub};

/// Joints of the skeleton, the pelvis first.
pub const N_JOINTS: usize = 22;

/// One frame: the global position of each joint in metres, y up.
pub type Pose = [[f32; 3]; N_JOINTS];

/// Name of each joint, in the order of [`Pose`].
pub const JOINT_NAMES: [&str; N_JOINTS] = [
    "pelvis",
    "left_hip",
    "right_hip",
    "spine1",
    "left_knee",
    "right_knee",
    "spine2",
    "left_ankle",
    "right_ankle",
    "spine3",
    "left_foot",
    "right_foot",
    "neck",
    "left_collar",
    "right_collar",
    "head",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
];

pub const L_HIP: usize = 1;
pub const R_HIP: usize = 2;
pub const L_SHOULDER: usize = 16;
pub const R_SHOULDER: usize = 17;

/// Kinematic chains: right leg, left leg, spine and head, right arm, left arm.
///
/// Each chain starts from the root's rotation, even the two arms, whose parent is joint 9.
pub const CHAINS: [&[usize]; 5] = [
    &[0, 2, 5, 8, 11],
    &[0, 1, 4, 7, 10],
    &[0, 3, 6, 9, 12, 15],
    &[9, 14, 17, 19, 21],
    &[9, 13, 16, 18, 20],
];

/// Parent of each joint, earlier in its chain; only the pelvis has none.
pub const PARENTS: [Option<usize>; N_JOINTS] = {
    let mut parents = [None; N_JOINTS];
    let mut chain = 0;
    while chain < CHAINS.len() {
        let mut bone = 1;
        while bone < CHAINS[chain].len() {
            parents[CHAINS[chain][bone]] = Some(CHAINS[chain][bone - 1]);
            bone += 1;
        }
        chain += 1;
    }
    parents
};

const UP: [f32; 3] = [0.0, 1.0, 0.0];
const DOWN: [f32; 3] = [0.0, -1.0, 0.0];
const LEFT: [f32; 3] = [1.0, 0.0, 0.0];
const RIGHT: [f32; 3] = [-1.0, 0.0, 0.0];
const FRONT: [f32; 3] = [0.0, 0.0, 1.0];

/// Unit direction from the parent to each joint in the rest pose, which faces +z.
pub const RAW_OFFSETS: [[f32; 3]; N_JOINTS] = [
    [0.0; 3], LEFT, RIGHT, UP, DOWN, DOWN, UP, DOWN, DOWN, UP, FRONT, FRONT, UP, LEFT, RIGHT,
    FRONT, DOWN, DOWN, DOWN, DOWN, DOWN, DOWN,
];

/// Distance in metres from each joint to its parent, shared by every clip of HumanML3D.
pub const BONE_LENGTHS: [f32; N_JOINTS] = [
    0.0, 0.1031, 0.1099, 0.1316, 0.3936, 0.3902, 0.1432, 0.4324, 0.4256, 0.0574, 0.1434, 0.1494,
    0.2194, 0.1375, 0.1434, 0.1030, 0.1316, 0.1230, 0.2568, 0.2631, 0.2660, 0.2699,
];

/// The joint on the other side of the body; joints of the middle are their own partners.
pub const MIRROR_PARTNER: [usize; N_JOINTS] =
    [0, 2, 1, 3, 5, 4, 6, 8, 7, 9, 11, 10, 12, 14, 13, 15, 17, 16, 19, 18, 21, 20];

/// Joints whose contacts are features: left ankle, left foot, right ankle, right foot.
pub const CONTACT_JOINTS: [usize; 4] = [7, 10, 8, 11];

/// Mean distance in millimetres between the joints of two motions, pelvis on pelvis in each frame.
///
/// `1000 / (T J) Σ_t Σ_j ‖(p_tj − p_t0) − (p̂_tj − p̂_t0)‖`, with the pelvis, whose distance is zero, among the J = 22
/// joints. Position and path of a body do not matter; its facing does.
///
/// # Panics
/// If the motions differ in length or hold no frame.
pub fn mpjpe_mm(truth: &[Pose], prediction: &[Pose]) -> f64 {
    assert_eq!(truth.len(), prediction.len(), "both motions have the same frames");
    assert!(!truth.is_empty(), "a motion without frames has no error");
    let metres: f64 = truth.iter().zip(prediction).map(|(a, b)| aligned_distance_m(a, b)).sum();
    1000.0 * metres / (truth.len() * N_JOINTS) as f64
}

/// Sum over joints of the distance between two poses with their pelvises on one point.
fn aligned_distance_m(a: &Pose, b: &Pose) -> f64 {
    let relative =
        |pose: &Pose, joint: usize| sub(pose[joint].map(f64::from), pose[0].map(f64::from));
    (0..N_JOINTS).map(|joint| norm(sub(relative(a, joint), relative(b, joint)))).sum()
}

// Where a body faces: the direction of the first frame, and the smoothed heading of the root.

/// Deviation in seconds of the Gaussian that smooths the heading.
const SIGMA_S: f64 = 1.0;
/// Deviations on either side that the Gaussian sees.
const SEEN: f64 = 4.0;

/// The turn that makes the body of `pose` face +z.
///
/// The body faces along `up × across`, where `across` leads from the left hip and shoulder to the
/// right ones. A pose in which that vector is vertical or zero faces nowhere and is not turned.
pub fn facing_turn(pose: &Pose) -> Yaw {
    forward(pose, [L_HIP, R_HIP]).and_then(|[x, z]| Yaw::to_face_z(x, z)).unwrap_or(Yaw::IDENTITY)
}

/// The root's rotation in each frame, from the smoothed heading; the first is the identity.
///
/// HumanML3D's inverse kinematics names the hips the other way round than its shoulders, so that
/// the hips' vector is *subtracted* from the shoulders'. All its files are made so, and we follow.
/// The quaternions' signs are chosen so that neighbours lie in one half-space: a step of feature 0
/// is then never taken the long way round. A frame that faces nowhere keeps the heading before it.
pub fn root_headings(poses: &[Pose], fps: f64) -> Vec<Yaw> {
    let (x, z) = (poses.iter())
        .scan([0.0, 1.0], |last, pose| {
            *last = forward(pose, [R_HIP, L_HIP]).unwrap_or(*last);
            Some((last[0], last[1]))
        })
        .unzip();
    let weights = gaussian(SIGMA_S * fps);
    let (x, z): (Vec<f64>, Vec<f64>) = (smoothed(x, &weights), smoothed(z, &weights));
    (x.iter().zip(&z).enumerate())
        .scan(Yaw::IDENTITY, |last, (t, (&x, &z))| {
            let yaw = if t == 0 { None } else { Yaw::to_face_z(x, z) }.unwrap_or(*last);
            *last = if yaw.dot(*last) < 0.0 { yaw.negated() } else { yaw };
            Some(*last)
        })
        .collect()
}

/// Horizontal part `[x, z]` of `up × across` for the unit vector `across`; shorter than 1 where
/// the body leans sideways.
fn forward(pose: &Pose, [hip_from, hip_to]: [usize; 2]) -> Option<[f64; 2]> {
    let across: [f64; 3] = std::array::from_fn(|c| {
        let at = |joint: usize| f64::from(pose[joint][c]);
        at(hip_to) - at(hip_from) + at(R_SHOULDER) - at(L_SHOULDER)
    });
    let length = norm(across);
    (length > 0.0).then(|| [across[2] / length, -across[0] / length])
}

/// `values` under the Gaussian, with the first and the last value repeated beyond the ends.
fn smoothed(values: Vec<f64>, gaussian: &[f64]) -> Vec<f64> {
    let (Some(&first), Some(&last)) = (values.first(), values.last()) else { return values };
    let beyond = gaussian.len() / 2;
    let padded = [vec![first; beyond], values.clone(), vec![last; beyond]].concat();
    let mut sums = vec![0.0; values.len()];
    // Weight by weight, not value by value: the inner loop then has no sum to carry.
    for (k, weight) in gaussian.iter().enumerate() {
        for (sum, value) in sums.iter_mut().zip(&padded[k..]) {
            *sum += weight * value;
        }
    }
    sums
}

/// Weights of the Gaussian with a deviation of so many frames, with sum 1; an odd number.
fn gaussian(sigma: f64) -> Vec<f64> {
    let radius = (SEEN * sigma).round();
    let weight = |k: usize| (-0.5 * ((k as f64 - radius) / sigma).powi(2)).exp();
    let weights: Vec<f64> = (0..=2 * radius as usize).map(weight).collect();
    let sum: f64 = weights.iter().sum();
    weights.into_iter().map(|weight| weight / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::fixtures::{dance, moved};

    #[test]
    fn chains_visit_every_bone_once_from_parent_to_child() {
        let mut seen = [0; N_JOINTS];
        for bone in CHAINS.iter().flat_map(|chain| chain.windows(2)) {
            assert_eq!(PARENTS[bone[1]], Some(bone[0]), "joint {}", JOINT_NAMES[bone[1]]);
            seen[bone[1]] += 1;
        }
        let parents = [0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19];
        assert_eq!(PARENTS[0], None);
        assert_eq!(PARENTS[1..], parents.map(Some));
        assert_eq!(seen[0], 0);
        assert_eq!(seen[1..], [1; N_JOINTS - 1]);
    }

    #[test]
    fn partners_agree_with_names_and_offsets() {
        for (joint, &partner) in MIRROR_PARTNER.iter().enumerate() {
            let name = JOINT_NAMES[joint];
            let swapped = match name.split_once('_') {
                Some(("left", part)) => format!("right_{part}"),
                Some(("right", part)) => format!("left_{part}"),
                _ => name.to_owned(),
            };
            assert_eq!(JOINT_NAMES[partner], swapped);
            let [x, y, z] = RAW_OFFSETS[joint];
            assert_eq!(RAW_OFFSETS[partner], [0.0 - x, y, z], "{name}");
        }
    }

    #[test]
    fn a_moved_body_has_no_error_and_a_moved_wrist_counts_for_one_joint() {
        let poses = dance(10);
        assert!(mpjpe_mm(&poses, &moved(&poses, 0.0, [1.0, 2.0, 3.0])) < 1e-3);
        let mut bent = poses.clone();
        bent.iter_mut().for_each(|pose| pose[21][1] += 0.022);
        assert!((mpjpe_mm(&poses, &bent) - 1.0).abs() < 1e-4);
    }
}

#[cfg(test)]
mod heading_tests {
    use super::*;
    use crate::motion::N_JOINTS;

    /// A pose with its left side towards `(x, z)` of its right.
    fn turned(x: f32, z: f32) -> Pose {
        let mut pose = [[0.0; 3]; N_JOINTS];
        (pose[L_HIP], pose[R_HIP]) = ([0.1 * x, 1.0, 0.1 * z], [-0.1 * x, 1.0, -0.1 * z]);
        (pose[L_SHOULDER], pose[R_SHOULDER]) = ([0.2 * x, 1.4, 0.2 * z], [-0.2 * x, 1.4, -0.2 * z]);
        pose
    }

    #[test]
    fn a_body_with_its_left_towards_x_faces_z_already() {
        assert_eq!(facing_turn(&turned(1.0, 0.0)), Yaw::IDENTITY);
        let (x, z) = facing_turn(&turned(0.0, -1.0)).rotate_xz(1.0, 0.0);
        assert!(x.abs() < 1e-7 && (z - 1.0).abs() < 1e-7);
    }

    #[test]
    fn smoothing_keeps_a_constant_and_halves_a_step() {
        let weights = gaussian(20.0);
        assert_eq!(weights.len(), 161);
        assert!(smoothed(vec![3.0; 10], &weights).iter().all(|v| (v - 3.0).abs() < 1e-12));
        let step = smoothed([vec![-1.0; 200], vec![1.0; 200]].concat(), &weights);
        assert!((step[199] + step[200]).abs() < 1e-12);
        // One deviation from the step: erf(1/√2), less the tails that the window cuts off.
        assert!((step[219] - 0.6827).abs() < 0.02, "{}", step[219]);
        assert!((step[0] + 1.0).abs() < 1e-12 && (step[399] - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_heading_of_a_spinning_body_never_changes_sign() {
        let spin = |t: usize| turned((t as f32 * 0.05).cos(), (t as f32 * 0.05).sin());
        let headings = root_headings(&(0..400).map(spin).collect::<Vec<_>>(), 20.0);
        assert_eq!(headings[0], Yaw::IDENTITY);
        assert!(headings.windows(2).skip(1).all(|pair| pair[0].dot(pair[1]) > 0.99));
        assert!(headings.iter().any(|heading| heading.w < -0.9), "it went round");
    }

    #[test]
    fn a_body_that_faces_nowhere_keeps_its_heading() {
        let shapeless = [[0.0; 3]; N_JOINTS];
        assert_eq!(facing_turn(&shapeless), Yaw::IDENTITY);
        assert_eq!(root_headings(&[shapeless; 5], 20.0), [Yaw::IDENTITY; 5]);
    }
}
