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

use super::geometry::{Yaw, between, conjugate, dot, multiply, sub, to_6d};
use super::skeleton::{CHAINS, CONTACT_JOINTS, Pose, RAW_OFFSETS, facing_turn, root_headings};
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

/// Frames a second of HumanML3D, in which its threshold and its smoothing are told.
const REFERENCE_FPS: f64 = 20.0;
/// A foot is in contact while the square of its step stays below this, in square metres at that rate.
const CONTACT_THRESHOLD_M2: f64 = 0.002;

/// Features of `T + 1` poses that stand anywhere and face anywhere, 20 frames a second: [`canonicalise`], then
/// [`features_of_canonical`].
///
/// # Shapes
/// `[T + 1]` poses to row-major `[T, 263]`; fewer than two poses give no rows.
pub fn build_features(poses: &[Pose]) -> Vec<f32> {
    build_features_at(poses, REFERENCE_FPS)
}

/// The same of poses of `fps` frames a second.
pub fn build_features_at(poses: &[Pose], fps: f64) -> Vec<f32> {
    features_of_canonical_at(&canonicalise(poses), fps)
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

/// Features of `T + 1` canonical poses, 20 frames a second.
///
/// A bone without length keeps the rotation of the bone before it.
///
/// # Shapes
/// As of [`build_features`].
pub fn features_of_canonical(poses: &[Pose]) -> Vec<f32> {
    features_of_canonical_at(poses, REFERENCE_FPS)
}

/// The same of poses of `fps` frames a second: a foot is in contact below the same speed, and the heading is
/// smoothed over the same time.
pub fn features_of_canonical_at(poses: &[Pose], fps: f64) -> Vec<f32> {
    features_with_headings(poses, &root_headings(poses, fps), fps)
}

/// The square of a step, in square metres, below which a foot is in contact.
pub(super) fn still_m2(fps: f64) -> f32 {
    (CONTACT_THRESHOLD_M2 * (REFERENCE_FPS / fps).powi(2)) as f32
}

/// The same where the heading of each pose is known.
pub(super) fn features_with_headings(poses: &[Pose], headings: &[Yaw], fps: f64) -> Vec<f32> {
    let still_m2 = still_m2(fps);
    let mut features = vec![0.0; poses.len().saturating_sub(1) * N_FEATURES];
    for (t, row) in features.chunks_exact_mut(N_FEATURES).enumerate() {
        write_root(row, &poses[t], &poses[t + 1], headings[t], headings[t + 1]);
        write_positions(&mut row[POSITIONS], &poses[t], headings[t]);
        write_rotations(&mut row[ROTATIONS], &poses[t], headings[t]);
        write_steps(row, &poses[t], &poses[t + 1], headings[t]);
        write_contacts(&mut row[CONTACTS], &poses[t], &poses[t + 1], still_m2);
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
}

fn write_contacts(columns: &mut [f32], pose: &Pose, next: &Pose, still_m2: f32) {
    for (column, joint) in columns.iter_mut().zip(CONTACT_JOINTS) {
        let step = sub(next[joint], pose[joint]);
        *column = f32::from(u8::from(dot(step, step) < still_m2));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::fixtures::{dance, from_6d, largest_difference, moved, poses64, procedural};
    use crate::motion::geometry::norm;
    use crate::motion::{L_HIP, L_SHOULDER, N_JOINTS, R_HIP, R_SHOULDER, rotate};

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

    #[test]
    fn feet_and_headings_do_not_depend_on_the_rate() {
        use crate::motion::retarget::resampled;
        let slow = procedural(3);
        let fast = resampled(&poses64(slow.len()), 20.0, 120.0);
        let fast: Vec<Pose> = fast.iter().map(|pose| pose.map(|j| j.map(|c| c as f32))).collect();
        let touching = |features: &[f32]| {
            let rows = features.chunks_exact(N_FEATURES);
            let (n, sum) = (rows.len() * 4, rows.flat_map(|row| &row[CONTACTS]).sum::<f32>());
            sum / n as f32
        };
        let headings = |features: &[f32], step: usize| -> Vec<f32> {
            let turns = features.chunks_exact(N_FEATURES).scan(0.0, |sum, row| {
                *sum += row[ROOT_YAW];
                Some(*sum)
            });
            turns.skip(step - 1).step_by(step).collect()
        };
        let (truth, found) = (build_features(&slow), build_features_at(&fast, 120.0));
        let (few, all) = (touching(&truth), touching(&build_features(&fast)));
        assert!((touching(&found) - few).abs() < 0.03 && all > few + 0.2, "{few} {all}");
        let off = largest_difference(&headings(&truth, 1), &headings(&found, 6));
        assert!(off < 0.02, "{off} rad");
    }
}
