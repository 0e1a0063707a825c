//! Poses on the skeleton that motion is brought to: with its bones, and at another rate.

use super::body::{BACKWARDS, Body, Pose64, Up};
use crate::motion::bvh::Axis;
use crate::motion::geometry::{Point, add, norm, scale, sub, with_length};
use crate::motion::{BONE_LENGTHS, N_JOINTS, PARENTS, Pose, rotate};

/// Length of the target's leg, hip to knee to ankle, the mean of both sides; metres.
pub fn leg() -> f64 {
    [4, 5, 7, 8].iter().map(|&joint| f64::from(BONE_LENGTHS[joint])).sum::<f64>() / 2.0
}

/// The pose with every bone as long as the target's, each in its direction.
pub fn with_lengths(pose: &Pose64) -> Pose64 {
    let mut found = *pose;
    for joint in 1..N_JOINTS {
        let parent = PARENTS[joint].unwrap_or(0);
        let bone = with_length(sub(pose[joint], pose[parent]), f64::from(BONE_LENGTHS[joint]));
        found[joint] = add(found[parent], bone.unwrap_or_default());
    }
    found
}

// Places of the 22 joints, of any body and with any axis up, on the skeleton.

/// Metres that a bone may differ from the target's and still be the target's.
const SAME: f64 = 1e-3;

/// Poses on the target's skeleton.
#[derive(Clone, Debug, PartialEq)]
pub struct Settled {
    pub poses: Vec<Pose64>,
    /// Metres of the target in one of the file's units; `None` if the bones are the target's already, and
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

/// The poses with y up and the target's bones: each bone keeps its direction, and the root's motion is scaled by the
/// length of the legs (HumanML3D's `uniform_skeleton`).
///
/// # Errors
/// [`PointsError`].
pub fn settled(poses: &[Pose64], told: Option<Up>) -> Result<Settled, PointsError> {
    let up = told.or(Up::along(height(poses))).ok_or(PointsError::Up)?;
    let poses: Vec<Pose64> =
        poses.iter().map(|pose| pose.map(|joint| rotate(up.turn(), joint))).collect();
    if toes_forward(&poses) < BACKWARDS {
        return Err(PointsError::Backwards);
    }
    if poses.iter().all(|pose| has_target_bones(pose, SAME)) {
        return Ok(Settled { poses, unit_m: None });
    }
    let mean = mean_leg(&poses);
    if mean <= 0.0 {
        return Err(PointsError::NoLegs);
    }
    let unit_m = leg() / mean;
    let moved = poses.iter().map(|pose| with_lengths(&pose.map(|joint| scale(joint, unit_m))));
    Ok(Settled { poses: moved.collect(), unit_m: Some(unit_m) })
}

/// The sum over frames of the directions from the ankles to the shoulders.
fn height(poses: &[Pose64]) -> Point {
    poses.iter().map(|pose| Body::from(pose).height()).fold([0.0; 3], add)
}

/// How far the toes point to where the body faces, y up, from −1 to 1, on the mean.
fn toes_forward(poses: &[Pose64]) -> f64 {
    let forward = |pose: &Pose64| Body::from(pose).toes_forward(Axis::Y.unit());
    poses.iter().filter_map(forward).sum::<f64>() / poses.len().max(1) as f64
}

/// Whether each bone is as long as the target's, to so many metres.
pub fn has_target_bones(pose: &Pose64, metres: f64) -> bool {
    (1..N_JOINTS).all(|joint| {
        let bone = norm(sub(pose[joint], pose[PARENTS[joint].unwrap_or(0)]));
        (bone - f64::from(BONE_LENGTHS[joint])).abs() < metres
    })
}

fn mean_leg(poses: &[Pose64]) -> f64 {
    poses.iter().map(|pose| Body::from(pose).leg()).sum::<f64>() / poses.len() as f64
}

/// What poses that should be in metres with y up say of their unit, their axes and their sides.
pub struct Stance {
    /// Mean length of the legs, as a multiple of the target's.
    pub legs: f64,
    /// The sum over frames of the directions from the ankles to the shoulders.
    pub height: Point,
    /// How far the toes point to where the body faces, from −1 to 1, on the mean.
    pub toes: f64,
}

impl Stance {
    /// Of a motion; its numbers are NaN without frames.
    pub fn of(poses: &[Pose]) -> Self {
        let wide = |pose: &Pose| pose.map(|place| place.map(f64::from));
        let poses: Vec<Pose64> = poses.iter().map(wide).collect();
        let (legs, toes) = (mean_leg(&poses) / leg(), toes_forward(&poses));
        Self { legs, height: height(&poses), toes }
    }
}

// Poses at another rate.

/// Times closer to a frame than this share of a frame are that frame's.
const ON_FRAME: f64 = 1e-6;

/// Poses at `to` frames per second, by Catmull-Rom splines through those at `from`; the bones keep the target's
/// lengths. The first pose stays the first, and none lies beyond the last.
pub fn resampled(poses: &[Pose64], from: f64, to: f64) -> Vec<Pose64> {
    let Some(last) = poses.len().checked_sub(1) else { return Vec::new() };
    let step = from / to;
    let n = (last as f64 / step + ON_FRAME).floor() as usize + 1;
    (0..n).map(|k| at(poses, k as f64 * step)).collect()
}

fn at(poses: &[Pose64], time: f64) -> Pose64 {
    let nearest = time.round();
    let last = poses.len() - 1;
    if (time - nearest).abs() < ON_FRAME * nearest.max(1.0) {
        return poses[(nearest as usize).min(last)];
    }
    let first = (time.floor() as usize).min(last);
    let near = [first.saturating_sub(1), first, (first + 1).min(last), (first + 2).min(last)];
    let weights = weights(time - time.floor());
    let mut pose = [[0.0; 3]; N_JOINTS];
    for (frame, weight) in near.into_iter().zip(weights) {
        for (sum, value) in pose.as_flattened_mut().iter_mut().zip(poses[frame].as_flattened()) {
            *sum += weight * value;
        }
    }
    with_lengths(&pose)
}

/// The spline through the frames before, at, after and beyond the interval (Catmull and Rom 1974).
fn weights(t: f64) -> [f64; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        (-t3 + 2.0 * t2 - t) / 2.0,
        (3.0 * t3 - 5.0 * t2 + 2.0) / 2.0,
        (-3.0 * t3 + 4.0 * t2 + t) / 2.0,
        (t3 - t2) / 2.0,
    ]
}

#[cfg(test)]
mod tests {
    use super::super::body::reflected;
    use super::*;
    use crate::motion::fixtures::{dance, largest_distance, poses64};

    fn poses(n: usize) -> Vec<Pose64> {
        dance(n).iter().map(|pose| with_lengths(&pose.map(|joint| joint.map(f64::from)))).collect()
    }

    #[test]
    fn half_way_weights_are_those_of_the_spline() {
        assert_eq!(weights(0.5), [-0.0625, 0.5625, 0.5625, -0.0625]);
        assert_eq!(weights(0.0), [0.0, 1.0, 0.0, 0.0]);
        assert_eq!(weights(1.0), [0.0, 0.0, 1.0, 0.0]);
    }

    #[test]
    fn frames_on_the_grid_stay_as_they_are() {
        let poses = poses(31);
        let every_sixth: Vec<Pose64> = poses.iter().step_by(6).copied().collect();
        assert_eq!(resampled(&poses, 120.0, 20.0), every_sixth);
        let slower = resampled(&poses, 30.0, 20.0);
        assert_eq!((slower.len(), slower[2], slower[20]), (21, poses[3], poses[30]));
        assert_eq!(resampled(&poses, 20.0, 20.0), poses);
        assert!(resampled(&[], 30.0, 20.0).is_empty());
    }

    #[test]
    fn poses_between_frames_are_near_what_was_there() {
        let poses = poses(61);
        let every_second: Vec<Pose64> = poses.iter().step_by(2).copied().collect();
        let found = resampled(&every_second, 10.0, 20.0);
        assert_eq!(found.len(), 61);
        let pairs =
            found.as_flattened().as_flattened().iter().zip(poses.as_flattened().as_flattened());
        let off = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 0.03, "{off} m");
    }

    #[test]
    fn joints_of_the_target_stay_as_they_are_and_others_take_its_lengths() {
        let poses: Vec<Pose64> = poses64(30).iter().map(with_lengths).collect();
        let same = settled(&poses, None).unwrap();
        assert!(same.unit_m.is_none() && same.poses == poses);
        let centimetres: Vec<Pose64> = poses.iter().map(|p| p.map(|j| scale(j, 100.0))).collect();
        let found = settled(&centimetres, None).unwrap();
        assert!((found.unit_m.unwrap() - 0.01).abs() < 1e-6);
        assert!(largest_distance(&found.poses, &poses) < 1e-5);
        let mirrored: Vec<Pose64> = poses.iter().map(|pose| pose.map(reflected)).collect();
        assert!(settled(&mirrored, None).is_err_and(|error| error == PointsError::Backwards));
        let lying: Vec<Pose64> =
            poses.iter().map(|pose| pose.map(|[x, y, z]| [x + y, y - x, z])).collect();
        assert!(settled(&lying, None).is_err_and(|error| error == PointsError::Up));
    }
}
