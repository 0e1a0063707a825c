//! The hierarchy that is written: the 22 joints, and a base below the chest for each collar.

use super::hierarchy::Axis;
use crate::motion::{JOINT_NAMES, N_JOINTS, PARENTS};

/// The joint below which collars get bases.
const CHEST: usize = 9;
const NECK: usize = 12;
/// Left collar, right collar.
const COLLARS: [usize; 2] = [13, 14];

/// A joint of the hierarchy.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    pub name: String,
    pub parent: Option<usize>,
    /// The joint of the skeleton where the node lies.
    pub joint: usize,
    /// Joints of the skeleton that the node's rotation brings to their places.
    pub aims: Vec<usize>,
}

/// Nodes depth first, each after its parent.
///
/// A joint with one child turns that child to its place. Pelvis and chest turn three at once, as
/// rigid bodies. Shoulders rise against the neck, so each collar has a base of its own on the
/// chest's place, without length, that turns it: CMU's skeletons do the same.
pub fn nodes() -> Vec<Node> {
    let mut nodes = Vec::with_capacity(N_JOINTS + COLLARS.len());
    add(&mut nodes, 0, None);
    nodes
}

fn add(nodes: &mut Vec<Node>, joint: usize, parent: Option<usize>) {
    let aims: Vec<usize> = (0..N_JOINTS).filter(|&child| PARENTS[child] == Some(joint)).collect();
    let own = nodes.len();
    let name = JOINT_NAMES[joint].to_owned();
    nodes.push(Node { name, parent, joint, aims: aims.clone() });
    for aim in aims {
        let below = if COLLARS.contains(&aim) { add_base(nodes, aim, own) } else { own };
        add(nodes, aim, Some(below));
    }
}

fn add_base(nodes: &mut Vec<Node>, aim: usize, parent: usize) -> usize {
    let name = format!("{}_base", JOINT_NAMES[aim]);
    nodes.push(Node { name, parent: Some(parent), joint: CHEST, aims: vec![aim] });
    nodes.len() - 1
}

/// How much the place of a joint counts among those that one rotation serves: the neck for the
/// chest above all, because the collars have bases.
pub fn weight(joint: usize) -> f64 {
    if joint == NECK { 1e4 } else { 1.0 }
}

/// Direction from its parent to each joint in the rest pose: a T, palms down, facing +z.
///
/// Lengths play no part. The three of the pelvis and the three of the chest are where the search
/// for a clip's own angles begins.
pub const REST_DIRECTIONS: [[f64; 3]; N_JOINTS] = {
    const UP: [f64; 3] = [0.0, 1.0, 0.0];
    const DOWN: [f64; 3] = [0.0, -1.0, 0.0];
    const LEFT: [f64; 3] = [1.0, 0.0, 0.0];
    const RIGHT: [f64; 3] = [-1.0, 0.0, 0.0];
    const FRONT: [f64; 3] = [0.0, 0.0, 1.0];
    const HIPS: [[f64; 3]; 2] = [[0.6, -0.8, 0.0], [-0.6, -0.8, 0.0]];
    const COLLARS: [[f64; 3]; 2] = [[0.6, 0.8, 0.0], [-0.6, 0.8, 0.0]];
    [
        [0.0; 3], HIPS[0], HIPS[1], UP, DOWN, DOWN, UP, DOWN, DOWN, UP, FRONT, FRONT, UP,
        COLLARS[0], COLLARS[1], UP, LEFT, RIGHT, LEFT, RIGHT, LEFT, RIGHT,
    ]
};

/// The axis along which the bones that leave a node lie in the rest pose, more or less; that of
/// the bone before it where none leaves.
pub fn rest_axis(node: &Node) -> Axis {
    let aim = match node.aims[..] {
        [aim] => aim,
        [] => node.joint,
        // Turned about the vertical first, sideways next: a body that lies on its side is rare.
        _ => return Axis::Z,
    };
    Axis::along(REST_DIRECTIONS[aim])
}
