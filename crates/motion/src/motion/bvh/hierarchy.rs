//! [`Bvh`]: what a BVH file says.

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
    pub fn along(direction: [f64; 3]) -> Axis {
        let part = |axis: &Axis| direction[*axis as usize].abs();
        Axis::ALL.into_iter().max_by(|a, b| part(a).total_cmp(&part(b))).unwrap_or(Axis::Y)
    }

    /// The unit vector along the axis.
    pub fn unit(self) -> [f64; 3] {
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
    /// Place in the parent's frame, in the file's unit of length, where no channel says another.
    pub offset: [f64; 3],
    /// What each frame gives, in this order; rotations apply from right to left.
    pub channels: Vec<Channel>,
    /// Offsets of the End Sites, which have no channels.
    pub end_sites: Vec<[f64; 3]>,
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

impl Bvh {
    /// Numbers in a frame.
    pub fn n_channels(&self) -> usize {
        self.joints.iter().map(|joint| joint.channels.len()).sum()
    }
}
