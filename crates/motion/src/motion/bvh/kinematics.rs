//! Forward kinematics: channels into positions.

use super::hierarchy::{Bvh, BvhJoint, Channel};
use crate::motion::vector::add;
use crate::motion::{JOINT_NAMES, N_JOINTS, NO_ROTATION, Pose, Quat, multiply, rotate};

/// Centimetres in a metre: files are written in centimetres.
pub const CM_PER_M: f64 = 100.0;

/// A joint in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// From the joint's own frame to that of the file.
    pub rotation: Quat,
    /// In the file's unit of length.
    pub position: [f64; 3],
}

impl Bvh {
    /// The place of each joint in each frame, in the file's unit of length.
    ///
    /// `p = p_parent + R_parent t` and `R = R_parent R_1 R_2 R_3` with the joint's rotations in the
    /// order of its channels. `t` is OFFSET, with the numbers of the position channels in the place
    /// of its own, as the files of the Bandai Namco motion data set mean it; a file whose root has
    /// OFFSET 0 means the same to readers that add the two.
    ///
    /// # Shapes
    /// `[T]` frames of as many points as there are joints. End Sites are no joints.
    ///
    /// # Panics
    /// If a frame has another length than [`Bvh::n_channels`].
    pub fn positions(&self) -> Vec<Vec<[f64; 3]>> {
        let points = |joints: Vec<Placed>| joints.iter().map(|joint| joint.position).collect();
        self.placed().into_iter().map(points).collect()
    }

    /// Place and rotation of each joint in each frame; see [`Bvh::positions`].
    ///
    /// # Panics
    /// If a frame has another length than [`Bvh::n_channels`].
    pub fn placed(&self) -> Vec<Vec<Placed>> {
        let whole = |frame: &&Vec<f64>| {
            assert_eq!(frame.len(), self.n_channels(), "a number for each channel");
        };
        self.frames.iter().inspect(whole).map(|frame| self.place(frame)).collect()
    }

    /// The pose of the OFFSETs alone, without a turn.
    pub fn zero_pose(&self) -> Vec<Placed> {
        self.place(&[])
    }

    /// The poses of a file that names its joints as [`JOINT_NAMES`] and is in centimetres, as
    /// [`fit_bvh`](super::fit_bvh) makes them; further joints play no part. Metres.
    ///
    /// `None` where a name is missing.
    pub fn poses(&self) -> Option<Vec<Pose>> {
        let find = |name: &&str| self.joints.iter().position(|joint| joint.name == **name);
        let joints: Vec<usize> = JOINT_NAMES.iter().map(find).collect::<Option<_>>()?;
        let metres = |point: [f64; 3]| point.map(|c| (c / CM_PER_M) as f32);
        let pose = |points: &Vec<[f64; 3]>| -> Pose {
            std::array::from_fn::<_, N_JOINTS, _>(|joint| metres(points[joints[joint]]))
        };
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
fn local(joint: &BvhJoint, values: &[f64]) -> (Quat, [f64; 3]) {
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
