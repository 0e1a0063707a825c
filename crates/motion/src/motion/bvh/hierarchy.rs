//! [`Bvh`]: the content of a BVH file; converts channels to positions, and rotations to channel angles.

use std::f64::consts::{PI, TAU};

use crate::motion::geometry::{Point, add};
use crate::motion::{JOINT_NAMES, NO_ROTATION, Pose, Quat, multiply, rotate};

/// An axis of a joint's frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    X,
    Y,
    Z,
}

impl Axis {
    pub const ALL: [Axis; 3] = [Axis::X, Axis::Y, Axis::Z];

    /// The axis along which a direction lies, more or less.
    pub fn along(direction: Point) -> Axis {
        let part = |axis: &Axis| direction[*axis as usize].abs();
        Axis::ALL.into_iter().max_by(|a, b| part(a).total_cmp(&part(b))).unwrap_or(Axis::Y)
    }

    /// The unit vector along the axis.
    pub fn unit(self) -> Point {
        Axis::ALL.map(|axis| f64::from(u8::from(axis == self)))
    }
}

/// A number that each frame gives for a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// The joint's place along an axis of its parent's frame, in the file's unit of length. It
    /// replaces the number of OFFSET.
    Position(Axis),
    /// A turn about an axis of the joint's frame, degrees.
    Rotation(Axis),
}

impl Channel {
    /// Every channel, and its word in a file.
    pub const NAMES: [(Channel, &str); 6] = [
        (Channel::Position(Axis::X), "Xposition"),
        (Channel::Position(Axis::Y), "Yposition"),
        (Channel::Position(Axis::Z), "Zposition"),
        (Channel::Rotation(Axis::X), "Xrotation"),
        (Channel::Rotation(Axis::Y), "Yrotation"),
        (Channel::Rotation(Axis::Z), "Zrotation"),
    ];
}

/// A joint of the hierarchy.
#[derive(Clone, Debug, PartialEq)]
pub struct BvhJoint {
    pub name: String,
    /// Index of the parent, smaller than the joint's own; a ROOT has none.
    pub parent: Option<usize>,
    /// Position in the parent's frame, in the file's unit, unless channels override it.
    pub offset: Point,
    /// The values per frame, in this order; rotations apply from right to left.
    pub channels: Vec<Channel>,
    /// Offsets of the End Sites, which have no channels.
    pub end_sites: Vec<Point>,
}

/// A BVH file: joints in the file's order, which is depth first, and frames.
#[derive(Clone, Debug, PartialEq)]
pub struct Bvh {
    pub joints: Vec<BvhJoint>,
    /// Seconds from frame to frame.
    pub frame_time_s: f64,
    /// For each frame the channels of all joints, joint after joint.
    pub frames: Vec<Vec<f64>>,
}

// Forward kinematics: channels into positions.

/// Centimetres in a metre: files are written in centimetres.
pub const CM_PER_M: f64 = 100.0;

/// A joint in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// From the joint's own frame to that of the file.
    pub rotation: Quat,
    /// In the file's unit of length.
    pub position: Point,
}

impl Bvh {
    /// Numbers in a frame.
    pub fn n_channels(&self) -> usize {
        self.joints.iter().map(|joint| joint.channels.len()).sum()
    }

    /// The position of each joint in each frame, in the file's unit.
    ///
    /// `p = p_parent + R_parent t` and `R = R_parent R_1 R_2 R_3` with the joint's rotations in the
    /// order of its channels. `t` is OFFSET, replaced by the position channels if present, as the Bandai Namco motion data
    /// set intends; a file whose root has OFFSET 0 means the same to readers that add the two.
    ///
    /// # Shapes
    /// `[T]` frames of as many points as there are joints. End Sites are no joints.
    ///
    /// # Panics
    /// If a frame has another length than [`Bvh::n_channels`].
    pub fn positions(&self) -> Vec<Vec<Point>> {
        let points = |joints: Vec<Placed>| joints.iter().map(|joint| joint.position).collect();
        self.placed().into_iter().map(points).collect()
    }

    /// Place and rotation of each joint in each frame; see [`Bvh::positions`].
    ///
    /// # Panics
    /// If a frame has another length than [`Bvh::n_channels`].
    pub fn placed(&self) -> Vec<Vec<Placed>> {
        let n = self.n_channels();
        assert!(self.frames.iter().all(|frame| frame.len() == n), "a number for each channel");
        self.frames.iter().map(|frame| self.place(frame)).collect()
    }

    /// The pose of the OFFSETs alone, without a turn.
    pub fn zero_pose(&self) -> Vec<Placed> {
        self.place(&[])
    }

    /// The poses of a file that names its joints as [`JOINT_NAMES`] and is in centimetres, as
    /// [`fit_bvh`](super::fit_bvh) makes them; further joints play no part. Metres.
    ///
    /// `None` if a name is missing.
    pub fn poses(&self) -> Option<Vec<Pose>> {
        let find = |name: &&str| self.joints.iter().position(|joint| joint.name == **name);
        let joints: Vec<usize> = JOINT_NAMES.iter().map(find).collect::<Option<_>>()?;
        let metres = |point: Point| point.map(|c| (c / CM_PER_M) as f32);
        let pose = |points: &Vec<Point>| std::array::from_fn(|i| metres(points[joints[i]]));
        Some(self.positions().iter().map(pose).collect())
    }

    /// Joints with the channels of a frame, or, if that is empty, as their OFFSETs have them.
    fn place(&self, frame: &[f64]) -> Vec<Placed> {
        let mut placed: Vec<Placed> = Vec::with_capacity(self.joints.len());
        let mut left = frame;
        for joint in &self.joints {
            let (values, rest) = left.split_at(joint.channels.len().min(left.len()));
            left = rest;
            let (rotation, translation) = local(joint, values);
            placed.push(match joint.parent.map(|parent| placed[parent]) {
                None => Placed { rotation, position: translation },
                Some(parent) => Placed {
                    rotation: multiply(parent.rotation, rotation),
                    position: add(parent.position, rotate(parent.rotation, translation)),
                },
            });
        }
        placed
    }
}

/// A joint's rotation and place in its parent's frame.
pub fn local(joint: &BvhJoint, values: &[f64]) -> (Quat, Point) {
    let (mut rotation, mut translation) = (NO_ROTATION, joint.offset);
    for (channel, &value) in joint.channels.iter().zip(values) {
        match channel {
            Channel::Position(axis) => translation[*axis as usize] = value,
            Channel::Rotation(axis) => {
                let (sin, cos) = (value.to_radians() / 2.0).sin_cos();
                let [x, y, z] = axis.unit().map(|c| c * sin);
                rotation = multiply(rotation, [cos, x, y, z]);
            }
        }
    }
    (rotation, translation)
}

// Rotations as three turns about axes, without jumps from frame to frame.

/// Below this cosine of the middle angle, the outer turns share their axis.
const LOCKED: f64 = 1e-6;

/// Three different axes: `R = R_0(a) R_1(b) R_2(c)`.
pub type Order = [Axis; 3];

/// The order whose middle turn is about `axis`.
///
/// The outer turns coincide if the middle one is by 90°. A smallest rotation of a vector along `axis` reaches this only
/// if the vector is reversed, so limbs that rest along their middle axis avoid it.
pub fn order_around(axis: Axis) -> Order {
    match axis {
        Axis::X => [Axis::Z, Axis::X, Axis::Y],
        Axis::Y => [Axis::Z, Axis::Y, Axis::X],
        Axis::Z => [Axis::Y, Axis::Z, Axis::X],
    }
}

/// The angles in radians of `rotation` that are nearest to `before`.
///
/// Two triples within a whole turn give each rotation, `(a, b, c)` and `(a + π, π − b, c + π)`.
/// If the outer turns share their axis, the first keeps its angle.
pub fn angles(rotation: Quat, order: Order, before: Point) -> Point {
    let m = Turned::of(rotation, order);
    let first = if m.m[1][2].hypot(m.m[2][2]) < LOCKED {
        before[0]
    } else {
        (-m.parity * m.m[1][2]).atan2(m.m[2][2])
    };
    let [near, far] = [first, first + PI].map(|a| unwrapped(m.after(a), before));
    if distance(near, before) <= distance(far, before) { near } else { far }
}

/// A rotation matrix with rows and columns in the order of the turns.
struct Turned {
    m: [Point; 3],
    /// 1 for axes in the order of x y z, −1 for the reverse.
    parity: f64,
}

impl Turned {
    fn of(rotation: Quat, order: Order) -> Turned {
        let columns = order.map(|axis| rotate(rotation, axis.unit()));
        let m = std::array::from_fn(|i| columns.map(|column| column[order[i] as usize]));
        let forward = (order[0] as usize + 1) % 3 == order[1] as usize;
        Turned { m, parity: if forward { 1.0 } else { -1.0 } }
    }

    /// All three angles, given the first `a`: the rest are two turns.
    fn after(&self, a: f64) -> Point {
        let (sin, cos) = (self.parity * a).sin_cos();
        let second = |column: usize| cos * self.m[1][column] + sin * self.m[2][column];
        let third = |column: usize| cos * self.m[2][column] - sin * self.m[1][column];
        let b = (self.parity * self.m[0][2]).atan2(third(2));
        let c = (self.parity * second(0)).atan2(second(1));
        [a, b, c]
    }
}

/// Whole turns away from `angles`, each within half a turn of `before`.
fn unwrapped(angles: Point, before: Point) -> Point {
    std::array::from_fn(|i| angles[i] - TAU * ((angles[i] - before[i]) / TAU).round())
}

fn distance(a: Point, b: Point) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::FRAC_PI_2;

    fn turn(axis: Axis, angle: f64) -> Quat {
        let [x, y, z] = axis.unit().map(|c| c * (angle / 2.0).sin());
        [(angle / 2.0).cos(), x, y, z]
    }

    fn composed(order: Order, [a, b, c]: [f64; 3]) -> Quat {
        multiply(multiply(turn(order[0], a), turn(order[1], b)), turn(order[2], c))
    }

    fn same(a: Quat, b: Quat) -> bool {
        a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>().abs() > 1.0 - 1e-9
    }

    proptest! {
        #[test]
        fn angles_give_the_rotation_and_stay_near(
            axis in 0usize..3,
            at in prop::array::uniform3(-9.0..9.0f64),
            step in prop::array::uniform3(-0.3..0.3f64),
        ) {
            let order = order_around(Axis::ALL[axis]);
            let next = std::array::from_fn(|i| at[i] + step[i]);
            let found = angles(composed(order, next), order, at);
            prop_assert!(same(composed(order, found), composed(order, next)));
            // No further than the angles from which the rotation was made.
            let [found, made] = [found, next].map(|angles| distance(angles, at));
            prop_assert!(found <= made + 1e-6, "{found} {made}");
        }
    }

    #[test]
    fn where_the_outer_turns_share_their_axis_the_first_keeps_its_angle() {
        for axis in Axis::ALL {
            let (order, before) = (order_around(axis), [0.4, FRAC_PI_2, 0.1]);
            let rotation = composed(order, [0.9, FRAC_PI_2, 0.6]);
            let found = angles(rotation, order, before);
            assert!((found[0] - 0.4).abs() < 1e-9, "{found:?}");
            assert!(same(composed(order, found), rotation), "{found:?}");
        }
    }
}
