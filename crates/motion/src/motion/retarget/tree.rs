//! Where joints hang in a hierarchy.

use crate::motion::bvh::BvhJoint;

/// Ends of chains become joints of their own under this word after their parent's name.
pub const END: &str = " end";

/// The joint and those that it hangs from, itself first.
fn ancestors(joints: &[BvhJoint], joint: usize) -> Vec<usize> {
    std::iter::successors(Some(joint), |&joint| joints[joint].parent).collect()
}

/// The nearest joint that both hang from.
pub fn common(joints: &[BvhJoint], a: usize, b: usize) -> Option<usize> {
    let of_b = ancestors(joints, b);
    ancestors(joints, a).into_iter().find(|joint| of_b.contains(joint))
}

/// The joints below `from` on the way to `to`, which is the last; none where it does not hang there.
pub fn path(joints: &[BvhJoint], from: usize, to: usize) -> Vec<usize> {
    let up = ancestors(joints, to);
    let Some(at) = up.iter().position(|&joint| joint == from) else { return Vec::new() };
    up[..at].iter().rev().copied().collect()
}

/// The End Site of a joint that has one with a length.
pub fn end(joints: &[BvhJoint], joint: usize) -> Option<usize> {
    let is_end = |child: &BvhJoint| {
        child.parent == Some(joint)
            && child.name.ends_with(END)
            && child.offset.iter().any(|c| c.abs() > 0.0)
    };
    joints.iter().position(is_end)
}
