//! Converts features into joints (HumanML3D's `recover_from_ric`), and completes features from joint positions.

use super::features::{POSITIONS, ROOT_HEIGHT, ROOT_VELOCITY, ROOT_YAW, features_with_headings};
use super::geometry::Yaw;
use super::skeleton::{N_JOINTS, Pose};
use crate::motion::N_FEATURES;

/// The poses that `features` describe, from the root's steps and the joints' local positions.
///
/// The heading is the sum of the half turns before the frame, the root's place the sum of the
/// steps before it, each turned back by the heading of the frame that it leads to; sums are kept
/// in double precision. Rotations, velocities and contacts play no part. Motions decoded from
/// tokens begin at the origin, facing +z.
///
/// # Shapes
/// Row-major `[T, 263]`, not normalised, to `[T]` poses.
///
/// # Panics
/// If `features` does not consist of whole rows.
pub fn recover_joints(features: &[f32]) -> Vec<Pose> {
    recover_body::<N_JOINTS>(features)
}

/// Features that a body of so many joints has: 263 of 22, 251 of KIT-ML's 21.
///
/// The root has 4 of them and the contacts 4; each joint but the root has a place (3) and a rotation (6), and
/// every joint a velocity (3).
pub const fn feature_width(joints: usize) -> usize {
    4 + 9 * (joints - 1) + 3 * joints + 4
}

/// [`recover_joints`] of a body with `J` joints.
///
/// # Shapes
/// Row-major `[T, feature_width(J)]`, not normalised, to `[T]` bodies.
///
/// # Panics
/// If `features` does not consist of whole rows.
pub fn recover_body<const J: usize>(features: &[f32]) -> Vec<[[f32; 3]; J]> {
    let width = feature_width(J);
    assert!(features.len().is_multiple_of(width), "features come in rows of {width}");
    let mut root = Root { half_angle: 0.0, x: 0.0, z: 0.0 };
    (features.chunks_exact(width))
        .map(|row| {
            let pose = place(row, &root);
            root.advance(row);
            pose
        })
        .collect()
}

/// Position and facing of the root in a frame.
struct Root {
    half_angle: f64,
    x: f64,
    z: f64,
}

impl Root {
    /// Takes the step and the turn of `row`, which lead to the next frame.
    fn advance(&mut self, row: &[f32]) {
        let step = &row[ROOT_VELOCITY];
        self.half_angle += f64::from(row[ROOT_YAW]);
        let back = Yaw::from_half_angle(self.half_angle).inverse();
        let (x, z) = back.rotate_xz(f64::from(step[0]), f64::from(step[1]));
        self.x += x;
        self.z += z;
    }
}

fn place<const J: usize>(row: &[f32], root: &Root) -> [[f32; 3]; J] {
    let back = Yaw::from_half_angle(root.half_angle).inverse();
    let mut pose = [[0.0; 3]; J];
    pose[0] = [root.x as f32, row[ROOT_HEIGHT], root.z as f32];
    for (joint, local) in pose[1..].iter_mut().zip(row[POSITIONS.start..].chunks_exact(3)) {
        let (x, z) = back.rotate_xz(f64::from(local[0]), f64::from(local[2]));
        *joint = [(x + root.x) as f32, local[1], (z + root.z) as f32];
    }
    pose
}

/// All features of a motion of which the root and the joints' positions are known: these as they are,
/// and rotations, velocities and contacts of the poses that they describe. Where the last frame leads,
/// the body is as in that frame. There are `fps` frames a second.
///
/// # Shapes
/// Row-major `[T, 67]`, not normalised, to `[T, 263]`.
///
/// # Panics
/// If `known` does not consist of whole rows.
pub fn complete_features(known: &[f32], fps: f64) -> Vec<f32> {
    let width = POSITIONS.end;
    assert!(known.len().is_multiple_of(width), "the known features come in rows of {width}");
    let last = known.len().saturating_sub(width);
    let mut rows = Vec::with_capacity(known.len() / width * N_FEATURES + N_FEATURES);
    for row in known.chunks_exact(width).chain([&known[last..]]) {
        rows.extend_from_slice(row);
        rows.resize(rows.len() + N_FEATURES - row.len(), 0.0);
    }
    let turns = rows.chunks_exact(N_FEATURES).scan(0.0, |half_angle, row| {
        let heading = Yaw::from_half_angle(*half_angle);
        *half_angle += f64::from(row[ROOT_YAW]);
        Some(heading)
    });
    let headings: Vec<Yaw> = turns.collect();
    let mut features = features_with_headings(&recover_joints(&rows), &headings, fps);
    for (row, known) in features.chunks_exact_mut(N_FEATURES).zip(known.chunks_exact(width)) {
        row[..width].copy_from_slice(known);
    }
    features
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::fixtures::{dance, largest_difference, moved};
    use crate::motion::{CONTACTS, VELOCITIES, build_features, canonicalise};

    #[test]
    fn recovery_gives_the_canonical_poses_back() {
        let poses = moved(&dance(199), 1.0, [0.5, 0.2, -3.0]);
        let recovered = recover_joints(&build_features(&poses));
        let expected = canonicalise(&poses);
        assert_eq!(recovered.len(), 198);
        let difference = largest_difference(
            recovered.as_flattened().as_flattened(),
            expected[..198].as_flattened().as_flattened(),
        );
        assert!(difference < 1e-5, "{difference}");
    }

    #[test]
    fn bodies_of_other_joints_have_features_of_other_widths() {
        assert_eq!([feature_width(N_JOINTS), feature_width(21)], [N_FEATURES, 251]);
        // A body of two joints, the second a metre before the first, that turns by 90° and steps ahead.
        let mut rows = [[0.0; feature_width(2)]; 2];
        rows[0][ROOT_YAW] = std::f32::consts::FRAC_PI_4;
        rows[0][ROOT_VELOCITY].copy_from_slice(&[0.0, 1.0]);
        rows.iter_mut().for_each(|row| row[POSITIONS.start + 2] = 1.0);
        let bodies = recover_body::<2>(rows.as_flattened());
        assert_eq!(bodies[0], [[0.0; 3], [0.0, 0.0, 1.0]]);
        let off = (0..2).map(|i| (bodies[1][i][0] + 1.0 + i as f32).abs()).sum::<f32>();
        assert!(off < 1e-6, "{:?}", bodies[1]);
    }

    #[test]
    fn a_row_alone_stands_at_the_origin() {
        let mut row = [0.0; N_FEATURES];
        (row[ROOT_YAW], row[ROOT_HEIGHT]) = (0.5, 0.9);
        row[POSITIONS.start..POSITIONS.start + 3].copy_from_slice(&[0.1, 0.8, -0.2]);
        let pose = recover_joints(&row)[0];
        assert_eq!((pose[0], pose[1]), ([0.0, 0.9, 0.0], [0.1, 0.8, -0.2]));
    }

    #[test]
    fn a_turn_of_the_first_frame_shows_in_the_second() {
        let mut rows = [[0.0; N_FEATURES]; 2];
        rows[0][ROOT_YAW] = std::f32::consts::FRAC_PI_4;
        rows[0][ROOT_VELOCITY].copy_from_slice(&[0.0, 1.0]);
        // The body has turned by -90°, so its own z is -x of the room.
        let second = recover_joints(rows.as_flattened())[1];
        assert!((second[0][0] + 1.0).abs() < 1e-6 && second[0][2].abs() < 1e-6, "{:?}", second[0]);
    }

    #[test]
    fn what_follows_from_the_positions_comes_back() {
        let features = build_features(&dance(40));
        let known: Vec<f32> =
            features.chunks_exact(N_FEATURES).flat_map(|row| &row[..67]).copied().collect();
        let found = complete_features(&known, 20.0);
        assert_eq!(found.len(), features.len());
        // Where the last frame leads, its pose is not known.
        let before_last = features.len() - N_FEATURES;
        let off = largest_difference(&found[..before_last], &features[..before_last]);
        assert!(off < 1e-3, "{off}");
        let last = |x: &[f32]| x[before_last..][..VELOCITIES.start].to_vec();
        assert!(largest_difference(&last(&found), &last(&features)) < 1e-3);
        assert!(found[before_last..][CONTACTS].iter().all(|x| [0.0, 1.0].contains(x)));
    }

    #[test]
    fn no_frames_stay_none() {
        assert_eq!(complete_features(&[], 20.0), Vec::<f32>::new());
    }
}
