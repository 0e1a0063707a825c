//! [`Motion`], and corruptions of its joints: all features follow from the corrupted joints, so that velocities,
//! rotations and contacts agree with positions.

use std::f64::consts::TAU;
use std::iter;

use rand_chacha::ChaCha8Rng;

use crate::data::FeatureStats;
use crate::draws::{below, normal_pair, unit};
use crate::motion::{
    N_FEATURES, N_JOINTS, Pose, ROOT_YAW, VELOCITIES, Yaw, features_of_canonical_at, recover_joints,
};

/// A true motion.
pub struct Motion<'a> {
    /// `[T, 263]` row-major and raw.
    pub features: &'a [f32],
    pub stats: &'a FeatureStats,
    /// Frames per second.
    pub fps: f64,
    /// Frames that it keeps at least, if it has them: those of a row of the evaluator.
    pub least: usize,
}

/// Each pose is held for so many seconds, at least two frames; the first for a part that is drawn.
pub fn held(motion: &Motion, seconds: f64, rng: &mut ChaCha8Rng) -> Vec<f32> {
    let every = ((seconds * motion.fps).round() as usize).max(2);
    let phase = below(rng, every);
    // The first pose of a frame's still.
    let of = |frame: usize| frame.saturating_sub((frame + phase) % every);
    rebuilt(motion, |poses| (0..poses.len()).map(|frame| poses[of(frame)]).collect())
}

/// Every joint is off by normal noise on each coordinate, which lasts so many frames, from a drawn frame on.
pub fn displaced(
    motion: &Motion,
    millimetres: f64,
    frames: usize,
    rng: &mut ChaCha8Rng,
) -> Vec<f32> {
    let phase = below(rng, frames);
    let mut noise = iter::from_fn(|| Some(<[f64; 2]>::from(normal_pair(rng)))).flatten();
    let mut offset = [[0.0; 3]; N_JOINTS];
    let mut displaced = |(frame, pose): (usize, &Pose)| {
        if frame == 0 || (frame + phase).is_multiple_of(frames) {
            let metres = millimetres / 1000.0;
            let drawn = || noise.next().map_or(0.0, |noise| (noise * metres) as f32);
            offset.as_flattened_mut().fill_with(drawn);
        }
        moved(pose, |joint| offset[joint])
    };
    rebuilt(motion, |poses| poses.iter().enumerate().map(&mut displaced).collect())
}

/// The whole body moves at a speed in m/s, in a direction of the room that is drawn.
pub fn drifting(motion: &Motion, speed: f64, rng: &mut ChaCha8Rng) -> Vec<f32> {
    let (sin, cos) = (TAU * unit(rng)).sin_cos();
    let drifting = |(frame, pose): (usize, &Pose)| {
        let metres = speed * frame as f64 / motion.fps;
        moved(pose, |_| [(sin * metres) as f32, 0.0, (cos * metres) as f32])
    };
    rebuilt(motion, |poses| poses.iter().enumerate().map(drifting).collect())
}

/// The motion at so many times its speed: poses between two frames lie on the lines between their joints.
pub fn faster(motion: &Motion, factor: f64) -> Vec<f32> {
    rebuilt(motion, |poses| {
        let last = poses.len() - 1;
        let frames = ((last as f64 / factor) as usize).max(motion.least.min(last));
        let at = |frame: usize| {
            let time = (frame as f64 * factor).min(last as f64);
            let (from, share) = (time as usize, time.fract() as f32);
            let (pose, next) = (&poses[from], &poses[(from + 1).min(last)]);
            moved(pose, |joint| {
                std::array::from_fn(|axis| share * (next[joint][axis] - pose[joint][axis]))
            })
        };
        (0..=frames).map(at).collect()
    })
}

fn moved(pose: &Pose, by: impl Fn(usize) -> [f32; 3]) -> Pose {
    std::array::from_fn(|joint| {
        let (place, by) = (pose[joint], by(joint));
        std::array::from_fn(|axis| place[axis] + by[axis])
    })
}

/// The features, `[T, 263]`, of the `T + 1` poses of a motion after a change.
fn rebuilt(motion: &Motion, change: impl FnOnce(&[Pose]) -> Vec<Pose>) -> Vec<f32> {
    features_of_canonical_at(&change(&poses(motion.features)), motion.fps)
}

/// The poses of `T` frames of features, and the one that the last frame leads to.
fn poses(features: &[f32]) -> Vec<Pose> {
    let mut poses = recover_joints(features);
    let rows = features.chunks_exact(N_FEATURES);
    if let (Some(last), Some(pose)) = (rows.clone().next_back(), poses.last().copied()) {
        let turns = rows.map(|row| f64::from(row[ROOT_YAW])).sum::<f64>();
        let back = Yaw::from_half_angle(turns - f64::from(last[ROOT_YAW])).inverse();
        let step =
            |joint: usize| std::array::from_fn(|axis| last[VELOCITIES.start + 3 * joint + axis]);
        poses.push(moved(&pose, |joint| back.rotate(step(joint))));
    }
    poses
}

#[cfg(test)]
mod tests {
    use super::super::{Corruption, PATCH};
    use super::*;
    use crate::motion::{build_features, synth::Script};
    use rand_chacha::rand_core::SeedableRng;

    fn truth() -> Vec<f32> {
        build_features(&Script::sample(&mut ChaCha8Rng::seed_from_u64(3)).poses())
    }

    fn made(corruption: Corruption, strength: f64) -> Vec<f32> {
        let stats = FeatureStats { mean: vec![0.0; N_FEATURES], std: vec![1.0; N_FEATURES] };
        let motion = Motion { features: &truth(), stats: &stats, fps: 20.0, least: 4 };
        corruption.of(&motion, strength, &mut ChaCha8Rng::seed_from_u64(1))
    }

    /// Between features that are no contacts.
    fn largest(a: &[f32], b: &[f32]) -> f32 {
        let rows = a.chunks_exact(N_FEATURES).zip(b.chunks_exact(N_FEATURES));
        let each = rows.flat_map(|(a, b)| a.iter().zip(b).take(VELOCITIES.end));
        each.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn a_corruption_of_no_size_changes_no_feature() {
        let truth = truth();
        for corruption in [Corruption::Jitter, Corruption::Steps, Corruption::Drift] {
            let made = made(corruption, 0.0);
            assert_eq!(made.len(), truth.len());
            assert!(largest(&made, &truth) < 2e-3, "{corruption:?}: {}", largest(&made, &truth));
        }
        assert!(largest(&made(Corruption::Speed, 1.0), &truth) < 2e-3);
    }

    #[test]
    fn stills_of_five_hertz_move_once_in_four_frames() {
        let made = made(Corruption::Stills, 0.2);
        assert_eq!(made.len(), truth().len());
        let moves: Vec<bool> = (made.chunks_exact(N_FEATURES))
            .map(|row| row[VELOCITIES].iter().any(|step| step.abs() > 1e-5))
            .collect();
        let at: Vec<usize> = (0..moves.len()).filter(|&frame| moves[frame]).collect();
        assert!(at.len() > 5 && at.windows(2).all(|two| (two[1] - two[0]) % 4 == 0), "{at:?}");
    }

    #[test]
    fn jitter_and_steps_have_the_size_that_is_asked_for() {
        for (corruption, lasts) in [(Corruption::Jitter, 1), (Corruption::Steps, PATCH)] {
            let (truth, made) = (truth(), made(corruption, 10.0));
            // By how much the upward steps of joints differ, which no heading changes.
            let rows = truth.chunks_exact(N_FEATURES).zip(made.chunks_exact(N_FEATURES));
            let upward = || (VELOCITIES.start + 1..VELOCITIES.end).step_by(3);
            let off = rows
                .flat_map(|(a, b)| upward().map(move |column| f64::from(a[column] - b[column])));
            let (kept, changed): (Vec<f64>, Vec<f64>) = off.partition(|metres| metres.abs() < 1e-5);
            let share = kept.len() as f64 / (kept.len() + changed.len()) as f64;
            assert!((share - (1.0 - 1.0 / lasts as f64)).abs() < 0.03, "{corruption:?}: {share}");
            let squares = changed.iter().map(|metres| metres.powi(2)).sum::<f64>();
            // Differences of two coordinates that deviate by 10 mm.
            let deviation = (squares / changed.len() as f64).sqrt();
            assert!((deviation - 0.0141).abs() < 0.001, "{corruption:?}: {deviation}");
        }
    }

    #[test]
    fn a_drift_ends_as_far_away_as_its_speed_says() {
        let both = [made(Corruption::Drift, 0.4), truth()].map(|motion| recover_joints(&motion));
        let last = both[1].len() - 1;
        let [a, b] = both.map(|poses| poses[last][0]);
        let metres = f64::from((a[0] - b[0]).hypot(a[2] - b[2]));
        assert!((metres - 0.4 * last as f64 / 20.0).abs() < 0.02, "{metres} m after {last} frames");
    }

    #[test]
    fn a_faster_motion_is_shorter_and_where_the_truth_is_later() {
        let [made, truth] = [made(Corruption::Speed, 1.3), truth()].map(|all| recover_joints(&all));
        assert_eq!(made.len(), (truth.len() as f64 / 1.3) as usize);
        for (frame, pose) in made.iter().enumerate().step_by(10) {
            let later = &truth[frame / 10 * 13];
            let off = pose[0].iter().zip(&later[0]).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f32::max) < 5e-3, "frame {frame}: {:?} {:?}", pose[0], later[0]);
        }
    }
}
