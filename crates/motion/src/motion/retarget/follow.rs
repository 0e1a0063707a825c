//! Frames of a file as poses of HumanML3D's skeleton.

use super::body::Body;
use super::rest::REST;
use super::rig::Rig;
use super::survey::carrier;
use super::target::{Pose64, leg};
use crate::motion::bvh::Placed;
use crate::motion::vector::{Point, add, scale, sub, with_length};
use crate::motion::{BONE_LENGTHS, N_JOINTS, PARENTS, multiply, rotate};

/// Metres of the target in one of the file's units: the ratio of the legs, the mean over the frames.
///
/// `None` without frames, and where the legs have no length.
pub fn unit_m(frames: &[Vec<Placed>], rig: &Rig) -> Option<f64> {
    let legs = frames.iter().map(|joints| Body::of(joints, &rig.roles).leg());
    let mean = legs.sum::<f64>() / frames.len() as f64;
    (mean > 0.0 && mean.is_finite()).then(|| leg() / mean)
}

/// The pose of a frame: thighs, shins and arms lie along the file's own, trunk, collars, shoulders and feet
/// keep the target's shape and turn with the joints that carry them; the middle of the hips is the file's,
/// `unit_m` metres a unit.
pub fn follow(joints: &[Placed], rig: &Rig, unit_m: f64) -> Pose64 {
    let body = Body::of(joints, &rig.roles);
    let turn = rig.up.turn();
    let bone = |joint: usize| -> Point {
        let parent = PARENTS[joint].unwrap_or(0);
        let rest = REST.iter().find(|(own, _)| *own == joint);
        let bone = match (rest, carrier(&rig.roles, joint)) {
            (Some(&(_, rest)), Some(carrier)) => {
                rotate(multiply(joints[carrier].rotation, rig.rests[joint]), rest)
            }
            _ => sub(body.at(joint), body.at(parent)),
        };
        rotate(turn, with_length(bone, f64::from(BONE_LENGTHS[joint])).unwrap_or_default())
    };
    let hips = rotate(turn, scale(body.hips(), unit_m));
    let mut pose = [[0.0; 3]; N_JOINTS];
    pose[0] = sub(hips, scale(add(bone(1), bone(2)), 0.5));
    for joint in 1..N_JOINTS {
        pose[joint] = add(pose[PARENTS[joint].unwrap_or(0)], bone(joint));
    }
    pose
}
