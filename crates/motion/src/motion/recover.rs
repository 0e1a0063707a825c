//! Features into joints: HumanML3D's `recover_from_ric`.

use super::features::{POSITIONS, ROOT_HEIGHT, ROOT_VELOCITY, ROOT_YAW};
use super::rotation::Yaw;
use super::skeleton::{N_JOINTS, Pose};

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
pub const fn width(joints: usize) -> usize {
    4 + 9 * (joints - 1) + 3 * joints + 4
}

/// [`recover_joints`] of a body with `J` joints.
///
/// # Shapes
/// Row-major `[T, width(J)]`, not normalised, to `[T]` bodies.
///
/// # Panics
/// If `features` does not consist of whole rows.
pub fn recover_body<const J: usize>(features: &[f32]) -> Vec<[[f32; 3]; J]> {
    let width = width(J);
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

/// Where the root stands and faces in a frame.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::N_FEATURES;
    use crate::motion::fixtures::{dance, largest_difference, moved};
    use crate::motion::{build_features, canonicalise};

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
        assert_eq!([width(N_JOINTS), width(21)], [N_FEATURES, 251]);
        // A body of two joints, the second a metre before the first, that turns by 90° and steps ahead.
        let mut rows = [[0.0; width(2)]; 2];
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
}
