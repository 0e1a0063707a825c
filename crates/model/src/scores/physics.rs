//! [`Physics`]: statistics of a motion that need no evaluator.

use serde::{Deserialize, Serialize};

use super::ScoreError;
use crate::motion::{CONTACT_JOINTS, ON_FLOOR, PARENTS, Pose};

/// A foot on the floor that moves faster than this, in metres a second, in a step and on the mean of the steps around
/// it, slides: 2.5 cm a frame of 20 a second.
const SLIDING: f64 = 0.5;

/// Steps of this mean on either side of a step; steps beyond the ends count as still.
const AROUND: usize = 2;

/// Physical implausibility of a motion; 0 is best except for jerk, which should be compared with true motions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Physics {
    /// Skating ratio: share of the steps from frame to frame in which a foot on the floor slides, as the code of
    /// Karunratanakul et al. (2023) counts them.
    pub foot_skate: f64,
    /// Mean size of the third derivative of the joints' places, in m/s³.
    pub jerk: f64,
    /// Standard deviation of a bone's length over time, mean over the bones, in millimetres.
    pub bone_spread_mm: f64,
    /// Depth of the lowest joint below the floor at 0, mean over the frames, in millimetres.
    pub penetration_mm: f64,
}

/// That of one motion of `fps` frames per second.
///
/// # Errors
/// [`ScoreError::TooFew`] below four frames, which have no jerk.
pub fn physics(poses: &[Pose], fps: f64) -> Result<Physics, ScoreError> {
    ScoreError::unless_enough("jerk", "frames", 4, poses.len())?;
    Ok(Physics {
        foot_skate: foot_skate(poses, fps),
        jerk: jerk(poses, fps),
        bone_spread_mm: bone_spread_mm(poses),
        penetration_mm: penetration_mm(poses),
    })
}

fn foot_skate(poses: &[Pose], fps: f64) -> f64 {
    // Of ankle and toe of each foot, the toes.
    let [left, right] = [CONTACT_JOINTS[1], CONTACT_JOINTS[3]].map(|toe| slides(poses, toe, fps));
    let sliding = left.iter().zip(&right).filter(|(left, right)| **left || **right);
    sliding.count() as f64 / (poses.len() - 1) as f64
}

/// Whether a toe slides, step by step.
fn slides(poses: &[Pose], toe: usize, fps: f64) -> Vec<bool> {
    let steps = poses.windows(2).map(|step| [step[0][toe], step[1][toe]]);
    let speed = |[a, b]: [[f32; 3]; 2]| f64::from((b[0] - a[0]).hypot(b[2] - a[2])) * fps;
    let speeds: Vec<f64> = steps.clone().map(speed).collect();
    let around = |step: usize| {
        let window = step.saturating_sub(AROUND)..(step + AROUND + 1).min(speeds.len());
        speeds[window].iter().sum::<f64>() / (2 * AROUND + 1) as f64
    };
    let slides = |(step, [a, b]): (usize, [[f32; 3]; 2])| {
        a[1].max(b[1]) < ON_FLOOR && speeds[step] > SLIDING && around(step) > SLIDING
    };
    steps.enumerate().map(slides).collect()
}

/// Mean size of the third derivative of the joints' places, in m/s³, of four frames or more.
pub(crate) fn jerk(poses: &[Pose], fps: f64) -> f64 {
    let third = |four: &[Pose], joint: usize| {
        let along = |axis: usize| {
            let at = |frame: usize| f64::from(four[frame][joint][axis]);
            at(3) - 3.0 * at(2) + 3.0 * at(1) - at(0)
        };
        (0..3).map(|axis| along(axis).powi(2)).sum::<f64>().sqrt()
    };
    let joints = PARENTS.len();
    let sizes = poses.windows(4).flat_map(|four| (0..joints).map(move |joint| third(four, joint)));
    let n = (poses.len() - 3) * joints;
    sizes.sum::<f64>() / n as f64 * fps.powi(3)
}

fn bone_spread_mm(poses: &[Pose]) -> f64 {
    let bones = PARENTS.iter().enumerate().filter_map(|(joint, parent)| Some((joint, (*parent)?)));
    let spreads: Vec<f64> = bones
        .map(|(joint, parent)| {
            let length = |pose: &Pose| {
                let between = pose[joint].iter().zip(&pose[parent]);
                between.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>().sqrt()
            };
            deviation(&poses.iter().map(length).collect::<Vec<f64>>())
        })
        .collect();
    1000.0 * spreads.iter().sum::<f64>() / spreads.len() as f64
}

fn deviation(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / n).sqrt()
}

fn penetration_mm(poses: &[Pose]) -> f64 {
    let depth = |pose: &Pose| pose.iter().map(|joint| -f64::from(joint[1])).fold(0.0, f64::max);
    1000.0 * poses.iter().map(depth).sum::<f64>() / poses.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{N_JOINTS, build_features, recover_joints, synth::Script};
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    /// Joints 10 cm apart, upwards; all of them at `place` of time t in seconds.
    fn body(n: usize, fps: f64, place: impl Fn(f64) -> [f64; 3]) -> Vec<Pose> {
        let pose = |frame: usize| {
            let [x, y, z] = place(frame as f64 / fps);
            std::array::from_fn(|joint| [x as f32, (y + 0.1 * joint as f64) as f32, z as f32])
        };
        (0..n).map(pose).collect()
    }

    #[test]
    fn jerk_is_the_third_derivative() {
        // x = t³ / 6 · 12: a jerk of 12.
        let cubic = physics(&body(20, 20.0, |t| [2.0 * t.powi(3), 0.0, 0.0]), 20.0).unwrap();
        assert!((cubic.jerk - 12.0).abs() < 0.1, "{cubic:?}");
        let steady = physics(&body(20, 30.0, |t| [t, 0.3, -t]), 30.0).unwrap();
        assert!(steady.jerk < 0.1 && steady.bone_spread_mm < 1e-3, "{steady:?}");
    }

    #[test]
    fn a_foot_slides_on_the_floor_and_not_above_it() {
        // The toes of this body are joints 10 and 11, a metre up: it has to sink for them to touch.
        let at = |height: f64, speed: f64| {
            let poses = body(11, 20.0, |t| [speed * t, height, 0.0]);
            physics(&poses, 20.0).unwrap().foot_skate
        };
        assert_eq!([at(-1.1, 0.9), at(-1.1, 0.4), at(-0.8, 0.9)], [1.0, 0.0, 0.0]);
        // At either end, three and four fifths of 0.6 m/s are too slow.
        assert_eq!(at(-1.1, 0.6), 0.6);
    }

    #[test]
    fn a_foot_that_jumps_once_does_not_slide() {
        let jump = |t: f64| if t > 0.4 { 0.1 } else { 0.0 };
        let poses = body(17, 20.0, |t| [jump(t), -1.1, 0.0]);
        assert_eq!(physics(&poses, 20.0).unwrap().foot_skate, 0.0, "2 m/s, 0.4 on the mean");
    }

    #[test]
    fn what_lies_below_the_floor_is_counted_by_its_depth() {
        let sunk = physics(&body(8, 20.0, |_| [0.0, -0.03, 0.0]), 20.0).unwrap();
        assert!((sunk.penetration_mm - 30.0).abs() < 1e-3, "{sunk:?}");
        assert_eq!(physics(&body(8, 20.0, |_| [0.0; 3]), 20.0).unwrap().penetration_mm, 0.0);
    }

    #[test]
    fn bones_that_stretch_are_seen() {
        let mut poses = body(10, 20.0, |_| [0.0; 3]);
        let last = N_JOINTS - 1;
        poses.iter_mut().step_by(2).for_each(|pose| pose[last][0] += 0.5);
        let spread = physics(&poses, 20.0).unwrap().bone_spread_mm;
        assert!(spread > 1.0, "{spread}");
    }

    #[test]
    fn a_procedural_motion_is_possible() {
        let script = Script::sample(&mut ChaCha8Rng::seed_from_u64(3));
        let found = physics(&script.poses(), 20.0).unwrap();
        assert!(found.bone_spread_mm < 1.0 && found.penetration_mm < 20.0, "{found:?}");
        assert!(found.foot_skate < 0.2, "{found:?}");
        let features = build_features(&script.poses());
        let again = physics(&recover_joints(&features), 20.0).unwrap();
        assert!((again.jerk - found.jerk).abs() < 0.1 * found.jerk, "{again:?} {found:?}");
    }

    #[test]
    fn three_frames_have_no_jerk() {
        let error = physics(&body(3, 20.0, |_| [0.0; 3]), 20.0).unwrap_err().to_string();
        assert_eq!(error, "jerk needs 4 frames or more, there are 3");
    }
}
