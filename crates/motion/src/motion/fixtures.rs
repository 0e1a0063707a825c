//! Made-up motions for the tests of this module.

use super::rotation::Yaw;
use super::skeleton::{BONE_LENGTHS, MIRROR_PARTNER, N_JOINTS, PARENTS, Pose, RAW_OFFSETS};
use super::vector::{cross, dot};

/// `n` frames of a body that walks a curve and swings every joint at its own pace.
pub(super) fn dance(n: usize) -> Vec<Pose> {
    (0..n).map(|t| figure(t as f32 / 20.0)).collect()
}

fn figure(t_s: f32) -> Pose {
    let mut pose = [[0.0; 3]; N_JOINTS];
    pose[0] = [t_s, 0.9 + 0.05 * (5.0 * t_s).sin(), 0.3 * t_s * t_s];
    for joint in 1..N_JOINTS {
        let parent = pose[PARENTS[joint].expect("only the pelvis has no parent")];
        let swing = |c: usize| 0.3 * ((1.0 + joint as f32 * 0.17) * t_s + c as f32).sin();
        pose[joint] = std::array::from_fn(|c| {
            parent[c] + BONE_LENGTHS[joint] * (RAW_OFFSETS[joint][c] + swing(c))
        });
    }
    moved(&[pose], f64::from(0.4 * t_s), [0.0; 3])[0]
}

/// `poses` turned by twice `half_angle` about the vertical through the origin, then shifted.
pub(super) fn moved(poses: &[Pose], half_angle: f64, shift: [f32; 3]) -> Vec<Pose> {
    let turn = Yaw::from_half_angle(half_angle);
    let place = |joint: [f32; 3]| {
        let turned = turn.rotate(joint);
        std::array::from_fn(|c| turned[c] + shift[c])
    };
    poses.iter().map(|pose| pose.map(place)).collect()
}

/// `poses` with x reversed and left and right joints in each other's place.
pub(super) fn mirrored_poses(poses: &[Pose]) -> Vec<Pose> {
    let flipped = |pose: &Pose, joint: usize| {
        let [x, y, z] = pose[MIRROR_PARTNER[joint]];
        [-x, y, z]
    };
    poses.iter().map(|pose| std::array::from_fn(|joint| flipped(pose, joint))).collect()
}

/// The largest distance between corresponding values.
pub(super) fn largest_difference(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max)
}

/// The rotation matrix, as its three columns, by Gram-Schmidt on the two columns `six`.
///
/// The columns need not be of unit length nor at right angles, as a decoder gives them; if they
/// are parallel or zero no rotation follows and the columns hold NaN.
pub(super) fn from_6d(six: [f32; 6]) -> [[f64; 3]; 3] {
    let [a, b, c, d, e, f] = six.map(f64::from);
    let x = normalised([a, b, c]);
    let z = normalised(cross(x, [d, e, f]));
    [x, cross(z, x), z]
}

/// `v` with length 1.
pub(super) fn normalised(v: [f64; 3]) -> [f64; 3] {
    let length = dot(v, v).sqrt();
    v.map(|c| c / length)
}
