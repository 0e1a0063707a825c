//! Inverse kinematics: positions of joints into a hierarchy's rotations.

use thiserror::Error;

use super::hierarchy::{
    Axis, Bvh, BvhJoint, CM_PER_M, Channel, Order, Placed, angles, order_around,
};
use super::text::rounded;
use crate::motion::geometry::{Point, add, align, norm, scale, sub, with_length};
use crate::motion::{
    JOINT_NAMES, N_JOINTS, NO_ROTATION, PARENTS, Pose, Quat, conjugate, multiply, rotate,
};

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

/// Fits a hierarchy to `poses` at `fps` frames per second.
///
/// Bones have their mean lengths over the clip. From the pelvis outwards, each node turns by the smallest rotation in
/// its parent's frame that points its bone from the joint's position in the file to the next joint's true position: no
/// joint twists against its parent, and errors do not accumulate. Pelvis and chest, with three bones each, turn by
/// least squares.
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
    let mut state = vec![Turn { rotation: NO_ROTATION, angles: [0.0; 3] }; nodes.len()];
    let frame = |pose| {
        turn_to(&mut state, pose, &nodes, &rest);
        channels(pose, &state)
    };
    let frames = poses.iter().map(frame).collect();
    let joints = joints(&nodes, &rest);
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
    angles: Point,
}

/// Turns the nodes from the frame before to `pose`.
fn turn_to(state: &mut [Turn], pose: &Pose, nodes: &[Node], rest: &Rest) {
    let mut placed: Vec<Placed> = Vec::with_capacity(nodes.len());
    for (index, node) in nodes.iter().enumerate() {
        let at = match node.parent.map(|parent| placed[parent]) {
            None => Placed { rotation: NO_ROTATION, position: pose[0].map(f64::from) },
            Some(at) => {
                let offset = rotate(at.rotation, offset(nodes, node, rest));
                Placed { position: add(at.position, offset), ..at }
            }
        };
        let before = state[index];
        let rotation = rotation(node, pose, rest, at, before.rotation);
        let angles = angles(rotation, node.order, before.angles);
        state[index] = Turn { rotation, angles };
        placed.push(Placed { rotation: multiply(at.rotation, rotation), ..at });
    }
}

/// The node's rotation in the frame of its parent, given the parent's rotation and the node's position `at`.
fn rotation(node: &Node, pose: &Pose, rest: &Rest, at: Placed, before: Quat) -> Quat {
    let back = conjugate(at.rotation);
    let present = |&aim: &usize| rotate(back, sub(pose[aim].map(f64::from), at.position));
    let bones: Vec<Point> = node.aims.iter().map(|&aim| rest[aim]).collect();
    let present: Vec<Point> = node.aims.iter().map(present).collect();
    // One bone leaves its twist open, and the rotation nearest to none is the smallest.
    let prior = if node.aims.len() > 1 { before } else { NO_ROTATION };
    weighted_align(&node.aims, &bones, &present, prior)
}

/// Position of a node in its parent's frame; `None` for a base, which coincides with its parent.
fn offset(nodes: &[Node], node: &Node, rest: &Rest) -> Point {
    let parent = node.parent.map(|parent| nodes[parent].joint);
    if parent == Some(node.joint) { [0.0; 3] } else { rest[node.joint] }
}

/// The numbers of a frame, as the file holds them.
fn channels(pose: &Pose, state: &[Turn]) -> Vec<f64> {
    let place = pose[0].iter().map(|&c| f64::from(c) * CM_PER_M);
    let turns = state.iter().flat_map(|turn| turn.angles).map(f64::to_degrees);
    place.chain(turns).map(rounded).collect()
}

fn joints(nodes: &[Node], rest: &Rest) -> Vec<BvhJoint> {
    let centimetres = |v: Point| scale(v, CM_PER_M).map(rounded);
    let joint = |node: &Node| {
        let positions = Axis::ALL.into_iter().map(Channel::Position);
        let positions = positions.filter(|_| node.parent.is_none());
        let end = node.aims.is_empty().then(|| centimetres(scale(rest[node.joint], END_SHARE)));
        BvhJoint {
            name: node.name.clone(),
            parent: node.parent,
            offset: centimetres(offset(nodes, node, rest)),
            channels: positions.chain(node.order.map(Channel::Rotation)).collect(),
            end_sites: end.into_iter().collect(),
        }
    };
    nodes.iter().map(joint).collect()
}

fn deviation(poses: &[Pose], bvh: &Bvh) -> Deviation {
    let said = bvh.poses().expect("the hierarchy has the skeleton's names");
    let distance = |(a, b): (&[f32; 3], &[f32; 3])| norm(sub(a.map(f64::from), b.map(f64::from)));
    let given = poses.as_flattened().iter();
    let mm: Vec<f64> = given.zip(said.as_flattened()).map(|pair| 1000.0 * distance(pair)).collect();
    let largest_mm = mm.iter().copied().fold(0.0, f64::max);
    Deviation { largest_mm, mean_mm: mm.iter().sum::<f64>() / mm.len() as f64 }
}

// The hierarchy that is written: the 22 joints, and a base below the chest for each collar.

const NECK: usize = 12;
/// Left collar, right collar.
const COLLARS: [usize; 2] = [13, 14];

/// A joint of the hierarchy.
#[derive(Clone, Debug, PartialEq)]
struct Node {
    name: String,
    parent: Option<usize>,
    /// The joint of the skeleton at the node.
    joint: usize,
    /// Joints of the skeleton that the node's rotation brings to their places.
    aims: Vec<usize>,
    order: Order,
}

impl Node {
    fn new(name: String, parent: Option<usize>, joint: usize, aims: Vec<usize>) -> Node {
        // The approximate axis of the node's outgoing bones in the rest pose; of its incoming bone if there is
        // none.
        let axis = match aims[..] {
            [aim] => Axis::along(REST_DIRECTIONS[aim]),
            [] => Axis::along(REST_DIRECTIONS[joint]),
            // Turned about the vertical first, sideways next: a body that lies on its side is rare.
            _ => Axis::Z,
        };
        Node { name, parent, joint, aims, order: order_around(axis) }
    }
}

/// Nodes depth first, each after its parent.
///
/// A joint with one child turns that child to its position. Pelvis and chest turn three at once, as rigid bodies.
/// Shoulders rise against the neck, so each collar has its own base at the chest, without length, that turns it, as in
/// CMU's skeletons.
fn nodes() -> Vec<Node> {
    let mut nodes = Vec::with_capacity(N_JOINTS + COLLARS.len());
    add_node(&mut nodes, 0, None);
    nodes
}

fn add_node(nodes: &mut Vec<Node>, joint: usize, parent: Option<usize>) {
    let aims: Vec<usize> = (0..N_JOINTS).filter(|&child| PARENTS[child] == Some(joint)).collect();
    let own = nodes.len();
    nodes.push(Node::new(JOINT_NAMES[joint].to_owned(), parent, joint, aims.clone()));
    for aim in aims {
        if COLLARS.contains(&aim) {
            let name = format!("{}_base", JOINT_NAMES[aim]);
            nodes.push(Node::new(name, Some(own), joint, vec![aim]));
        }
        let below = if COLLARS.contains(&aim) { nodes.len() - 1 } else { own };
        add_node(nodes, aim, Some(below));
    }
}

/// Direction from its parent to each joint in the rest pose: a T, palms down, facing +z.
///
/// Lengths are not used. The three of the pelvis and the three of the chest start the search for a clip's own angles.
const REST_DIRECTIONS: [Point; N_JOINTS] = {
    const UP: Point = [0.0, 1.0, 0.0];
    const DOWN: Point = [0.0, -1.0, 0.0];
    const LEFT: Point = [1.0, 0.0, 0.0];
    const RIGHT: Point = [-1.0, 0.0, 0.0];
    const FRONT: Point = [0.0, 0.0, 1.0];
    const HIPS: [Point; 2] = [[0.6, -0.8, 0.0], [-0.6, -0.8, 0.0]];
    const COLLARS: [Point; 2] = [[0.6, 0.8, 0.0], [-0.6, 0.8, 0.0]];
    [
        [0.0; 3], HIPS[0], HIPS[1], UP, DOWN, DOWN, UP, DOWN, DOWN, UP, FRONT, FRONT, UP,
        COLLARS[0], COLLARS[1], UP, LEFT, RIGHT, LEFT, RIGHT, LEFT, RIGHT,
    ]
};

// The rest pose of a clip: mean bone lengths, and the angles between bones that turn together.

/// One is exact for a rigid body; later ones settle the mean of a body that is not.
const ROUNDS: usize = 4;

/// Place in its parent's frame of each joint in the rest pose, metres; the pelvis lies at zero.
type Rest = [Point; N_JOINTS];

/// The rest pose of `poses`: bones as long as they are in the mean over the frames.
///
/// A bone that leaves its joint alone has the direction of [`REST_DIRECTIONS`]. Bones that leave a
/// joint together have the mean of their directions over the frames, each frame turned on average
/// (generalised Procrustes analysis, Gower 1975), and that mean is turned upright.
fn rest_pose(poses: &[Pose], nodes: &[Node]) -> Rest {
    let mut rest: Rest = std::array::from_fn(|joint| {
        let lengths = poses.iter().map(|pose| norm(bone(pose, joint)));
        let mean = lengths.sum::<f64>() / poses.len() as f64;
        with_length(REST_DIRECTIONS[joint], mean).unwrap_or_default()
    });
    for node in nodes.iter().filter(|node| node.aims.len() > 1) {
        let upright: Vec<Point> = node.aims.iter().map(|&aim| rest[aim]).collect();
        let shape = mean_shape(poses, &node.aims, upright);
        node.aims.iter().zip(shape).for_each(|(&aim, bone)| rest[aim] = bone);
    }
    rest
}

/// From a joint's parent to the joint, metres.
fn bone(pose: &Pose, joint: usize) -> Point {
    let parent = PARENTS[joint].unwrap_or(joint);
    sub(pose[joint].map(f64::from), pose[parent].map(f64::from))
}

fn mean_shape(poses: &[Pose], aims: &[usize], upright: Vec<Point>) -> Vec<Point> {
    let mut shape = upright.clone();
    for _ in 0..ROUNDS {
        shape = mean_turned_on(poses, aims, &shape);
    }
    let turn = weighted_align(aims, &shape, &upright, NO_ROTATION);
    shape.into_iter().map(|bone| rotate(turn, bone)).collect()
}

/// The mean of the frames' bones, each frame turned on `shape`; lengths are those of `shape`.
fn mean_turned_on(poses: &[Pose], aims: &[usize], shape: &[Point]) -> Vec<Point> {
    let mut sums = vec![[0.0; 3]; aims.len()];
    let mut turn = NO_ROTATION;
    for pose in poses {
        let present: Vec<Point> = aims.iter().map(|&aim| bone(pose, aim)).collect();
        turn = weighted_align(aims, shape, &present, turn);
        let back = conjugate(turn);
        sums.iter_mut().zip(present).for_each(|(sum, bone)| *sum = add(*sum, rotate(back, bone)));
    }
    let of_length = |(sum, bone): (&Point, &Point)| with_length(*sum, norm(*bone));
    sums.iter().zip(shape).map(|pair| of_length(pair).unwrap_or(*pair.1)).collect()
}

/// [`align`] where among the joints that one rotation serves the neck counts for the chest above all, because the
/// collars have bases.
fn weighted_align(aims: &[usize], from: &[Point], to: &[Point], prior: Quat) -> Quat {
    let weight = |aim: usize| if aim == NECK { 1e4 } else { 1.0 };
    let weighted = aims.iter().zip(from).map(|(&aim, &bone)| scale(bone, weight(aim)));
    align(&weighted.collect::<Vec<_>>(), to, prior)
}
