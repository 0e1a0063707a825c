//! The rest pose of a clip: mean bone lengths, and the angles between bones that turn together.

use super::nodes::{Node, REST_DIRECTIONS, weight};
use crate::motion::align::align;
use crate::motion::vector::{add, norm, scale, sub, with_length};
use crate::motion::{N_JOINTS, NO_ROTATION, PARENTS, Pose, Quat, conjugate, rotate};

/// One is exact for a rigid body; later ones settle the mean of a body that is not.
const ROUNDS: usize = 4;

/// Place in its parent's frame of each joint in the rest pose, metres; the pelvis lies at zero.
pub type Rest = [[f64; 3]; N_JOINTS];

/// The rest pose of `poses`: bones as long as they are in the mean over the frames.
///
/// A bone that leaves its joint alone has the direction of [`REST_DIRECTIONS`]. Bones that leave a
/// joint together have the mean of their directions over the frames, each frame turned on the mean
/// (generalised Procrustes analysis, Gower 1975), and that mean is turned upright.
pub fn rest_pose(poses: &[Pose], nodes: &[Node]) -> Rest {
    let lengths: [f64; N_JOINTS] = std::array::from_fn(|joint| mean_length(poses, joint));
    let mut rest: Rest = std::array::from_fn(|joint| {
        with_length(REST_DIRECTIONS[joint], lengths[joint]).unwrap_or([0.0; 3])
    });
    for node in nodes.iter().filter(|node| node.aims.len() > 1) {
        let upright: Vec<[f64; 3]> = node.aims.iter().map(|&aim| rest[aim]).collect();
        let shape = mean_shape(poses, &node.aims, upright);
        node.aims.iter().zip(shape).for_each(|(&aim, bone)| rest[aim] = bone);
    }
    rest
}

fn mean_length(poses: &[Pose], joint: usize) -> f64 {
    poses.iter().map(|pose| norm(bone(pose, joint))).sum::<f64>() / poses.len() as f64
}

/// From a joint's parent to the joint, metres.
fn bone(pose: &Pose, joint: usize) -> [f64; 3] {
    let parent = PARENTS[joint].unwrap_or(joint);
    sub(pose[joint].map(f64::from), pose[parent].map(f64::from))
}

fn mean_shape(poses: &[Pose], aims: &[usize], upright: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
    let mut shape = upright.clone();
    for _ in 0..ROUNDS {
        shape = mean_turned_on(poses, aims, &shape);
    }
    let turn = weighted_align(aims, &shape, &upright, NO_ROTATION);
    shape.into_iter().map(|bone| rotate(turn, bone)).collect()
}

/// The mean of the frames' bones, each frame turned on `shape`; lengths are those of `shape`.
fn mean_turned_on(poses: &[Pose], aims: &[usize], shape: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let mut sums = vec![[0.0; 3]; aims.len()];
    let mut turn = NO_ROTATION;
    for pose in poses {
        let present: Vec<[f64; 3]> = aims.iter().map(|&aim| bone(pose, aim)).collect();
        turn = weighted_align(aims, shape, &present, turn);
        let back = conjugate(turn);
        sums.iter_mut().zip(present).for_each(|(sum, bone)| *sum = add(*sum, rotate(back, bone)));
    }
    let of_length = |(sum, bone): (&[f64; 3], &[f64; 3])| with_length(*sum, norm(*bone));
    sums.iter().zip(shape).map(|pair| of_length(pair).unwrap_or(*pair.1)).collect()
}

/// [`align`] with the joints' [`weight`]s.
pub fn weighted_align(aims: &[usize], from: &[[f64; 3]], to: &[[f64; 3]], prior: Quat) -> Quat {
    let weighted = aims.iter().zip(from).map(|(&aim, &bone)| scale(bone, weight(aim)));
    align(&weighted.collect::<Vec<_>>(), to, prior)
}
