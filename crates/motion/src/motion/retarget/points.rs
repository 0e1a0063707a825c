//! Places of the 22 joints, of any body and with any axis up, on HumanML3D's skeleton.

use super::axes::Up;
use super::body::{BACKWARDS, Body};
use super::target::{Pose64, leg, with_lengths};
use crate::motion::bvh::Axis;
use crate::motion::vector::{add, norm, scale, sub};
use crate::motion::{BONE_LENGTHS, N_JOINTS, PARENTS, Pose, rotate};

/// Metres that a bone may differ from the target's and still be the target's.
const SAME: f64 = 1e-3;

/// Poses on the target's skeleton.
#[derive(Clone, Debug, PartialEq)]
pub struct Settled {
    pub poses: Vec<Pose64>,
    pub up: Up,
    /// Metres of the target in one of the file's units; `None` where the bones are the target's already, and
    /// the places stay as they are.
    pub unit_m: Option<f64>,
}

/// Why places of joints are no motion of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PointsError {
    #[error("stands along no axis, so that no axis is clearly up; give --up")]
    Up,
    #[error("has legs without length")]
    NoLegs,
    #[error(
        "has its toes behind its ankles: its axes are left-handed, or left and right are exchanged; give \
         --left-handed"
    )]
    Backwards,
}

/// The poses with y up and the target's bones: each keeps its direction, and the root moves as far as the
/// legs are long (HumanML3D's `uniform_skeleton`).
///
/// # Errors
/// [`PointsError`].
pub fn settled(poses: &[Pose64], told: Option<Up>) -> Result<Settled, PointsError> {
    let height = poses.iter().map(|pose| Body::from(pose).height()).fold([0.0; 3], add);
    let up = told.or(Up::along(height)).ok_or(PointsError::Up)?;
    let poses: Vec<Pose64> =
        poses.iter().map(|pose| pose.map(|joint| rotate(up.turn(), joint))).collect();
    if toes_forward(&poses) < BACKWARDS {
        return Err(PointsError::Backwards);
    }
    if poses.iter().all(has_target_bones) {
        return Ok(Settled { poses, up, unit_m: None });
    }
    let mean = mean_leg(&poses);
    if mean <= 0.0 {
        return Err(PointsError::NoLegs);
    }
    let unit_m = leg() / mean;
    let moved = poses.iter().map(|pose| with_lengths(&pose.map(|joint| scale(joint, unit_m))));
    Ok(Settled { poses: moved.collect(), up, unit_m: Some(unit_m) })
}

/// How far the toes point to where the body faces, from −1 to 1, on the mean.
fn toes_forward(poses: &[Pose64]) -> f64 {
    let forward = |pose: &Pose64| Body::from(pose).toes_forward(Axis::Y.unit());
    poses.iter().filter_map(forward).sum::<f64>() / poses.len().max(1) as f64
}

fn bone(pose: &Pose64, joint: usize) -> f64 {
    PARENTS[joint].map_or(0.0, |parent| norm(sub(pose[joint], pose[parent])))
}

fn has_target_bones(pose: &Pose64) -> bool {
    (0..N_JOINTS).all(|joint| (bone(pose, joint) - f64::from(BONE_LENGTHS[joint])).abs() < SAME)
}

fn mean_leg(poses: &[Pose64]) -> f64 {
    poses.iter().map(|pose| Body::from(pose).leg()).sum::<f64>() / poses.len() as f64
}

/// Mean length of the legs of poses in metres, as a multiple of the target's.
pub fn leg_ratio(poses: &[Pose]) -> f64 {
    let wide = |pose: &Pose| pose.map(|place| place.map(f64::from));
    mean_leg(&poses.iter().map(wide).collect::<Vec<Pose64>>()) / leg()
}
