//! Joints into features: HumanML3D's `process_file` without its change of skeleton.
//!
//! A row describes frame `t` and the step to `t + 1`, so `T + 1` poses give `T` rows of
//! [`N_FEATURES`] numbers. With `q_t` the root's heading, which turns the body to face +z:
//!
//! | columns | content |
//! | --- | --- |
//! | [`ROOT_YAW`] | arcsine of the y part of `q_{t+1} q_t⁻¹`: half the angle of the turn |
//! | [`ROOT_VELOCITY`] | x and z of the root's step, turned by `q_{t+1}`; metres a frame |
//! | [`ROOT_HEIGHT`] | y of the root, metres |
//! | [`POSITIONS`] | joints 1 to 21 relative to the root's x and z, turned by `q_t` |
//! | [`ROTATIONS`] | joints 1 to 21: rotation relative to the bone before it, 6-D |
//! | [`VELOCITIES`] | joints 0 to 21: step from `t` to `t + 1`, turned by `q_t` |
//! | [`CONTACTS`] | left ankle, left foot, right ankle, right foot: 1 if still, 0 if not |

use std::ops::Range;

use super::geometry::{Yaw, between, conjugate, dot, multiply, norm, sub, to_6d};
use super::skeleton::{
    CHAINS, CONTACT_JOINTS, L_HIP, L_SHOULDER, Pose, R_HIP, R_SHOULDER, RAW_OFFSETS,
};
use crate::motion::N_FEATURES;

/// Column of the root's half turn to the next frame, radians.
pub const ROOT_YAW: usize = 0;
/// Columns of the root's horizontal step.
pub const ROOT_VELOCITY: Range<usize> = 1..3;
/// Column of the root's height.
pub const ROOT_HEIGHT: usize = 3;
/// Columns of the positions of joints 1 to 21.
pub const POSITIONS: Range<usize> = 4..67;
/// Columns of the 6-D rotations of joints 1 to 21.
pub const ROTATIONS: Range<usize> = 67..193;
/// Columns of the steps of joints 0 to 21.
pub const VELOCITIES: Range<usize> = 193..259;
/// Columns of the four contacts.
pub const CONTACTS: Range<usize> = 259..263;

/// A foot is in contact while the square of its step stays below this, in square metres.
const CONTACT_THRESHOLD_M2: f32 = 0.002;

/// Features of `T + 1` poses at any place and facing: [`canonicalise`], then [`features_of_canonical`].
///
/// # Shapes
/// `[T + 1]` poses to row-major `[T, 263]`; fewer than two poses give no rows.
pub fn build_features(poses: &[Pose]) -> Vec<f32> {
    features_of_canonical(&canonicalise(poses))
}

/// `poses` moved so that the lowest joint of the clip touches `y = 0`, and turned so that the body
/// of the first frame stands at the origin and faces +z.
pub fn canonicalise(poses: &[Pose]) -> Vec<Pose> {
    let Some(first) = poses.first() else { return Vec::new() };
    let floor = lowest(poses);
    let [root_x, _, root_z] = first[0];
    let turn = facing_turn(first);
    let place = |[x, y, z]: [f32; 3]| turn.rotate([x - root_x, y - floor, z - root_z]);
    poses.iter().map(|pose| pose.map(place)).collect()
}

/// Height of the lowest joint of some poses.
pub(crate) fn lowest(poses: &[Pose]) -> f32 {
    poses.iter().flatten().map(|joint| joint[1]).fold(f32::INFINITY, f32::min)
}

/// Metres that a canonical clip may be off the origin and the floor.
const AT_ORIGIN: f32 = 1e-3;
/// Tolerance of the first facing direction from +z, radians.
const FACING: f64 = 1e-3;

/// Whether `poses` are as [`canonicalise`] leaves them, to a millimetre and a milliradian: places that were
/// rounded are not turned again.
pub fn is_canonical(poses: &[Pose]) -> bool {
    let Some(first) = poses.first() else { return true };
    let off = [first[0][0], first[0][2], lowest(poses)];
    let turn = facing_turn(first);
    off.iter().all(|metres| metres.abs() < AT_ORIGIN) && turn.w > 0.0 && turn.y.abs() < FACING / 2.0
}

/// Features of `T + 1` poses that are canonical already (see [`canonicalise`]).
///
/// A bone without length keeps the rotation of the bone before it.
///
/// # Shapes
/// `[T + 1]` poses to row-major `[T, 263]`; fewer than two poses give no rows.
pub fn features_of_canonical(poses: &[Pose]) -> Vec<f32> {
    features_with_headings(poses, &root_headings(poses))
}

/// The same with known headings.
pub(super) fn features_with_headings(poses: &[Pose], headings: &[Yaw]) -> Vec<f32> {
    let mut features = vec![0.0; poses.len().saturating_sub(1) * N_FEATURES];
    for (t, row) in features.chunks_exact_mut(N_FEATURES).enumerate() {
        write_root(row, &poses[t], &poses[t + 1], headings[t], headings[t + 1]);
        write_positions(&mut row[POSITIONS], &poses[t], headings[t]);
        write_rotations(&mut row[ROTATIONS], &poses[t], headings[t]);
        write_steps(row, &poses[t], &poses[t + 1], headings[t]);
    }
    features
}

fn write_root(row: &mut [f32], pose: &Pose, next: &Pose, heading: Yaw, next_heading: Yaw) {
    let [x, _, z] = next_heading.rotate(sub(next[0], pose[0]));
    row[ROOT_YAW] = heading.half_step_to(next_heading) as f32;
    row[ROOT_VELOCITY].copy_from_slice(&[x, z]);
    row[ROOT_HEIGHT] = pose[0][1];
}

fn write_positions(columns: &mut [f32], pose: &Pose, heading: Yaw) {
    let [root_x, _, root_z] = pose[0];
    for (column, [x, y, z]) in columns.chunks_exact_mut(3).zip(&pose[1..]) {
        column.copy_from_slice(&heading.rotate([x - root_x, *y, z - root_z]));
    }
}

/// Rotations by inverse kinematics from positions: `R_b = R_a⁻¹ R(o_b → p_b − p_a)` along each
/// chain, and `q_t` before its first bone, for the arms too, though they hang from joint 9.
///
/// `q_t` turns the room to the body, not the body to the room, so the first rotation of a chain is not the body's; this
/// follows HumanML3D's files, and only its own kinematics undo it.
fn write_rotations(columns: &mut [f32], pose: &Pose, heading: Yaw) {
    for chain in CHAINS {
        let mut parent = heading.quat();
        for bone in chain.windows(2) {
            let direction = sub(pose[bone[1]], pose[bone[0]]).map(f64::from);
            let global = between(RAW_OFFSETS[bone[1]].map(f64::from), direction).unwrap_or(parent);
            let six = to_6d(multiply(conjugate(parent), global));
            columns[(bone[1] - 1) * 6..bone[1] * 6].copy_from_slice(&six);
            parent = global;
        }
    }
}

fn write_steps(row: &mut [f32], pose: &Pose, next: &Pose, heading: Yaw) {
    for (column, (to, from)) in row[VELOCITIES].chunks_exact_mut(3).zip(next.iter().zip(pose)) {
        column.copy_from_slice(&heading.rotate(sub(*to, *from)));
    }
    for (column, joint) in row[CONTACTS].iter_mut().zip(CONTACT_JOINTS) {
        let step = sub(next[joint], pose[joint]);
        *column = f32::from(u8::from(dot(step, step) < CONTACT_THRESHOLD_M2));
    }
}

// Where a body faces: the direction of the first frame, and the smoothed heading of the root.

/// Deviation in frames of the Gaussian that smooths the heading: one second at 20 frames per second.
const SIGMA: f64 = 20.0;
/// Frames on either side that the Gaussian sees: four deviations.
const RADIUS: usize = 80;

/// The turn that makes the body of `pose` face +z.
///
/// The body faces along `up × across`, where `across` leads from the left hip and shoulder to the
/// right ones. A pose in which that vector is vertical or zero faces nowhere and is not turned.
fn facing_turn(pose: &Pose) -> Yaw {
    forward(pose, [L_HIP, R_HIP]).and_then(|[x, z]| Yaw::to_face_z(x, z)).unwrap_or(Yaw::IDENTITY)
}

/// The root's rotation in each frame, from the smoothed heading; the first is the identity.
///
/// HumanML3D's inverse kinematics names the hips the other way round than its shoulders, so that
/// the hips' vector is *subtracted* from the shoulders'. All its files are made so, and we follow.
/// The quaternions' signs are chosen so that neighbours lie in one half-space: a step of feature 0
/// is then never taken the long way round. A frame that faces nowhere keeps the heading before it.
fn root_headings(poses: &[Pose]) -> Vec<Yaw> {
    let (x, z) = (poses.iter())
        .scan([0.0, 1.0], |last, pose| {
            *last = forward(pose, [R_HIP, L_HIP]).unwrap_or(*last);
            Some((last[0], last[1]))
        })
        .unzip();
    let (x, z): (Vec<f64>, Vec<f64>) = (smoothed(x), smoothed(z));
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
fn smoothed(values: Vec<f64>) -> Vec<f64> {
    let (Some(&first), Some(&last)) = (values.first(), values.last()) else { return values };
    let padded = [vec![first; RADIUS], values.clone(), vec![last; RADIUS]].concat();
    let mut sums = vec![0.0; values.len()];
    // Weight by weight, not value by value: the inner loop then has no sum to carry.
    for (k, weight) in gaussian().into_iter().enumerate() {
        for (sum, value) in sums.iter_mut().zip(&padded[k..]) {
            *sum += weight * value;
        }
    }
    sums
}

/// Weights of the Gaussian from `-RADIUS` to `RADIUS`, with sum 1.
fn gaussian() -> [f64; 2 * RADIUS + 1] {
    let weights: [f64; 2 * RADIUS + 1] = std::array::from_fn(|k| {
        let distance = (k as f64 - RADIUS as f64) / SIGMA;
        (-0.5 * distance * distance).exp()
    });
    let sum: f64 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::fixtures::{dance, from_6d, largest_difference, moved};
    use crate::motion::{N_JOINTS, rotate};

    #[test]
    fn canonical_poses_touch_the_floor_at_the_origin_and_face_z() {
        let poses = canonicalise(&moved(&dance(50), 2.0, [3.0, -4.0, 5.0]));
        let across: [f32; 3] = std::array::from_fn(|c| {
            let pose = &poses[0];
            pose[R_HIP][c] - pose[L_HIP][c] + pose[R_SHOULDER][c] - pose[L_SHOULDER][c]
        });
        assert_eq!((lowest(&poses), poses[0][0][0], poses[0][0][2]), (0.0, 0.0, 0.0));
        assert!(across[2].abs() < 1e-6 && across[0] < -0.1, "{across:?}");
    }

    #[test]
    fn features_do_not_depend_on_place_or_direction() {
        let poses = dance(60);
        let elsewhere = build_features(&moved(&poses, -2.5, [10.0, 2.0, -7.0]));
        let difference = largest_difference(&build_features(&poses), &elsewhere);
        assert!(difference < 2e-5, "{difference}");
    }

    #[test]
    fn canonical_poses_stay_where_they_are() {
        let poses = canonicalise(&dance(60));
        let again = canonicalise(&poses);
        let difference = largest_difference(
            poses.as_flattened().as_flattened(),
            again.as_flattened().as_flattened(),
        );
        assert!(difference < 1e-6, "{difference}");
    }

    #[test]
    fn contacts_are_steps_shorter_than_the_root_of_the_threshold() {
        let mut poses = vec![canonicalise(&dance(2))[0]; 2];
        // Squares: 0.001936 and 0.002025, on either side of 0.002.
        poses[1][7][1] += 0.044;
        poses[1][8][1] += 0.045;
        poses[1][11][0] += 1.0;
        assert_eq!(features_of_canonical(&poses)[CONTACTS], [1.0, 1.0, 0.0, 0.0]);
    }

    #[test]
    fn positions_follow_from_rotations_with_each_chain_begun_at_the_root() {
        let poses = canonicalise(&dance(40));
        let mut half_angle = 0.0;
        for (row, pose) in features_of_canonical(&poses).chunks_exact(N_FEATURES).zip(&poses) {
            let placed = forward_kinematics(row, pose, Yaw::from_half_angle(half_angle));
            for (joint, (a, b)) in placed.iter().zip(pose).enumerate() {
                let close = a.iter().zip(b).all(|(a, b)| (a - f64::from(*b)).abs() < 1e-5);
                assert!(close, "joint {joint}: {a:?} is not {b:?}");
            }
            half_angle += f64::from(row[ROOT_YAW]);
        }
    }

    /// Joints from the row's rotations and heading, with the root and the bone lengths of `pose`.
    fn forward_kinematics(row: &[f32], pose: &Pose, heading: Yaw) -> [[f64; 3]; N_JOINTS] {
        let mut placed = [[0.0; 3]; N_JOINTS];
        placed[0] = pose[0].map(f64::from);
        for chain in CHAINS {
            let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            let mut global = axes.map(|axis| rotate(heading.quat(), axis));
            for bone in chain.windows(2) {
                let at = ROTATIONS.start + 6 * (bone[1] - 1);
                let local = from_6d(std::array::from_fn(|i| row[at + i]));
                global = local.map(|column| apply(&global, column));
                let step = sub(pose[bone[1]], pose[bone[0]]).map(f64::from);
                let turned =
                    apply(&global, RAW_OFFSETS[bone[1]].map(|c| f64::from(c) * norm(step)));
                placed[bone[1]] = std::array::from_fn(|c| placed[bone[0]][c] + turned[c]);
            }
        }
        placed
    }

    /// The matrix with `columns` times `v`.
    fn apply(columns: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| (0..3).map(|j| columns[j][i] * v[j]).sum())
    }

    #[test]
    fn fewer_than_two_poses_give_no_rows() {
        assert!(build_features(&[]).is_empty());
        assert!(build_features(&dance(1)).is_empty());
    }

    #[test]
    fn a_collapsed_body_still_gives_finite_features() {
        let features = build_features(&[[[1.0; 3]; N_JOINTS]; 4]);
        assert_eq!(features.len(), 3 * N_FEATURES);
        assert!(features.iter().all(|value| value.is_finite()));
    }

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
        assert!(smoothed(vec![3.0; 10]).iter().all(|v| (v - 3.0).abs() < 1e-12));
        let step = smoothed([vec![-1.0; 200], vec![1.0; 200]].concat());
        assert!((step[199] + step[200]).abs() < 1e-12);
        // One deviation from the step: erf(1/√2), less the tails that the window cuts off.
        assert!((step[219] - 0.6827).abs() < 0.02, "{}", step[219]);
        assert!((step[0] + 1.0).abs() < 1e-12 && (step[399] - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_heading_of_a_spinning_body_never_changes_sign() {
        let spin = |t: usize| turned((t as f32 * 0.05).cos(), (t as f32 * 0.05).sin());
        let headings = root_headings(&(0..400).map(spin).collect::<Vec<_>>());
        assert_eq!(headings[0], Yaw::IDENTITY);
        assert!(headings.windows(2).skip(1).all(|pair| pair[0].dot(pair[1]) > 0.99));
        assert!(headings.iter().any(|heading| heading.w < -0.9), "it went round");
    }

    #[test]
    fn a_body_that_faces_nowhere_keeps_its_heading() {
        let shapeless = [[0.0; 3]; N_JOINTS];
        assert_eq!(facing_turn(&shapeless), Yaw::IDENTITY);
        assert_eq!(root_headings(&[shapeless; 5]), [Yaw::IDENTITY; 5]);
    }
}
