//! Inverse kinematics: positions of joints into a hierarchy's rotations.

use thiserror::Error;

use super::euler::{Order, angles, order_around};
use super::format::rounded;
use super::hierarchy::{Axis, Bvh, BvhJoint, Channel};
use super::kinematics::{CM_PER_M, Placed};
use super::nodes::{Node, nodes, rest_axis};
use super::rest::{Rest, rest_pose, weighted_align};
use crate::motion::vector::{add, norm, scale, sub};
use crate::motion::{JOINT_NAMES, NO_ROTATION, Pose, Quat, conjugate, multiply, rotate};

/// An End Site lies this share of the last bone beyond it: no motion says where hands end.
const END_SHARE: f64 = 0.5;

/// A motion as a hierarchy, and how far that is from the motion.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedBvh {
    pub bvh: Bvh,
    pub deviation: Deviation,
}

/// Distance between the given joints and those of the file, over all frames and joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    pub largest_mm: f64,
    pub mean_mm: f64,
}

/// Why poses are no BVH.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum FitBvhError {
    #[error("a motion without frames has no bones; give at least one frame")]
    NoFrames,
    #[error("{fps} frames a second is no speed; give a finite number above zero")]
    Fps { fps: f32 },
    #[error("{joint} is at no place in frame {frame}: its coordinates are not finite")]
    NotFinite { frame: usize, joint: &'static str },
}

/// The hierarchy that comes nearest to `poses`, `fps` frames a second.
///
/// Bones have their mean lengths over the clip. From the pelvis outwards, each node turns by the
/// smallest rotation in its parent's frame that points its bone from where the file has the joint
/// to where the motion has the next one: no joint twists against its parent, and an error ends at
/// the joint that makes it. Pelvis and chest, with three bones each, turn by least squares.
///
/// # Shapes
/// `[T]` poses in metres to a file of T frames in centimetres and degrees.
///
/// # Errors
/// [`FitBvhError`] for no frames, an unusable `fps`, and coordinates that are not finite.
pub fn fit_bvh(poses: &[Pose], fps: f32) -> Result<FittedBvh, FitBvhError> {
    check(poses, fps)?;
    let nodes = nodes();
    let rest = rest_pose(poses, &nodes);
    let orders: Vec<Order> = nodes.iter().map(|node| order_around(rest_axis(node))).collect();
    let mut state = vec![Turn { rotation: NO_ROTATION, angles: [0.0; 3] }; nodes.len()];
    let frame = |pose| {
        turn_to(&mut state, pose, &nodes, &rest, &orders);
        channels(pose, &state)
    };
    let frames = poses.iter().map(frame).collect();
    let joints = joints(&nodes, &rest, &orders);
    let bvh = Bvh { joints, frame_time_s: 1.0 / f64::from(fps), frames };
    let deviation = deviation(poses, &bvh);
    Ok(FittedBvh { bvh, deviation })
}

fn check(poses: &[Pose], fps: f32) -> Result<(), FitBvhError> {
    if poses.is_empty() {
        return Err(FitBvhError::NoFrames);
    }
    if !(fps.is_finite() && fps > 0.0) {
        return Err(FitBvhError::Fps { fps });
    }
    let no_place = |pose: &Pose| pose.iter().position(|at| !at.iter().all(|c| c.is_finite()));
    match poses.iter().enumerate().find_map(|(frame, pose)| Some((frame, no_place(pose)?))) {
        Some((frame, joint)) => Err(FitBvhError::NotFinite { frame, joint: JOINT_NAMES[joint] }),
        None => Ok(()),
    }
}

/// A node's rotation in its parent's frame.
#[derive(Clone, Copy)]
struct Turn {
    rotation: Quat,
    /// The same as angles in radians; within half a turn of those of the frame before.
    angles: [f64; 3],
}

/// Turns the nodes from the frame before to `pose`.
fn turn_to(state: &mut [Turn], pose: &Pose, nodes: &[Node], rest: &Rest, orders: &[Order]) {
    let mut placed: Vec<Placed> = Vec::with_capacity(nodes.len());
    for (index, node) in nodes.iter().enumerate() {
        let mut at = match node.parent {
            None => Placed { rotation: NO_ROTATION, position: pose[0].map(f64::from) },
            Some(parent) => placed[parent],
        };
        if node.parent.is_some() {
            let offset = rotate(at.rotation, offset(nodes, node, rest));
            at.position = add(at.position, offset);
        }
        let before = state[index];
        let rotation = rotation(node, pose, rest, at, before.rotation);
        let angles = angles(rotation, orders[index], before.angles);
        state[index] = Turn { rotation, angles };
        placed.push(Placed { rotation: multiply(at.rotation, rotation), ..at });
    }
}

/// The node's rotation in the frame of its parent, which is that of `at`, where the node lies.
fn rotation(node: &Node, pose: &Pose, rest: &Rest, at: Placed, before: Quat) -> Quat {
    let back = conjugate(at.rotation);
    let present = |&aim: &usize| rotate(back, sub(pose[aim].map(f64::from), at.position));
    let bones: Vec<[f64; 3]> = node.aims.iter().map(|&aim| rest[aim]).collect();
    let present: Vec<[f64; 3]> = node.aims.iter().map(present).collect();
    // One bone leaves its twist open, and the rotation nearest to none is the smallest.
    let prior = if node.aims.len() > 1 { before } else { NO_ROTATION };
    weighted_align(&node.aims, &bones, &present, prior)
}

/// Place of a node in its parent's frame: none for a base, which lies where its parent lies.
fn offset(nodes: &[Node], node: &Node, rest: &Rest) -> [f64; 3] {
    let parent = node.parent.map(|parent| nodes[parent].joint);
    if parent == Some(node.joint) { [0.0; 3] } else { rest[node.joint] }
}

/// The numbers of a frame, as the file holds them.
fn channels(pose: &Pose, state: &[Turn]) -> Vec<f64> {
    let place = pose[0].iter().map(|&c| f64::from(c) * CM_PER_M);
    let turns = state.iter().flat_map(|turn| turn.angles).map(f64::to_degrees);
    place.chain(turns).map(rounded).collect()
}

fn joints(nodes: &[Node], rest: &Rest, orders: &[Order]) -> Vec<BvhJoint> {
    let centimetres = |v: [f64; 3]| scale(v, CM_PER_M).map(rounded);
    let joint = |(node, order): (&Node, &Order)| {
        let positions = Axis::ALL.into_iter().map(Channel::Position);
        let positions = positions.filter(|_| node.parent.is_none());
        let end = node.aims.is_empty().then(|| centimetres(scale(rest[node.joint], END_SHARE)));
        BvhJoint {
            name: node.name.clone(),
            parent: node.parent,
            offset: centimetres(offset(nodes, node, rest)),
            channels: positions.chain(order.map(Channel::Rotation)).collect(),
            end_sites: end.into_iter().collect(),
        }
    };
    nodes.iter().zip(orders).map(joint).collect()
}

fn deviation(poses: &[Pose], bvh: &Bvh) -> Deviation {
    let said = bvh.poses().expect("the hierarchy has the skeleton's names");
    let distance = |(a, b): (&[f32; 3], &[f32; 3])| norm(sub(a.map(f64::from), b.map(f64::from)));
    let given = poses.as_flattened().iter();
    let mm: Vec<f64> = given.zip(said.as_flattened()).map(|pair| 1000.0 * distance(pair)).collect();
    let largest_mm = mm.iter().copied().fold(0.0, f64::max);
    Deviation { largest_mm, mean_mm: mm.iter().sum::<f64>() / mm.len() as f64 }
}
