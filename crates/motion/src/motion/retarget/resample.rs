//! Poses at another rate.

use super::target::{Pose64, with_lengths};
use crate::motion::N_JOINTS;

/// Times closer to a frame than this share of a frame are that frame's.
const ON_FRAME: f64 = 1e-6;

/// Poses at `to` frames a second, by Catmull-Rom splines through those at `from`; the bones keep the target's
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

/// Of the frames before, at, after and beyond the interval (Catmull and Rom 1974).
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
    use super::*;
    use crate::motion::fixtures::dance;

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
}
