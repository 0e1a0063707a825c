//! [`Corruption`]: ways to make motions worse, to test that a score detects them, and to train an evaluator by.

mod joints;

pub use joints::Motion;

use std::ops::Range;

use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::draws::{below, normal_pair, swapped, unit};
use crate::motion::{N_FEATURES, VELOCITIES, mirror_features};

/// The column of the root's velocity along the facing direction, in metres a frame.
const ROOT_FORWARD: usize = 2;

/// A way in which motions are made worse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Corruption {
    /// Independent noise on every feature, in standard deviations of the feature.
    Noise,
    /// A share of the frames in another order.
    Shuffling,
    /// The body slides forward, in metres a second: feet that stood on the floor do not any more.
    Sliding,
    /// Poses that are held so many seconds each: 0.2 are stills of 5 Hz.
    Stills,
    /// Noise on the coordinates of every joint in every frame, in millimetres.
    Jitter,
    /// An offset of every joint that lasts four frames, in millimetres, as patches of a tokenizer make.
    Steps,
    /// The body drifts in a direction of the room, in metres a second.
    Drift,
    /// The motion is played so many times as fast, so it ends earlier.
    Speed,
    /// Left and right are exchanged, and the caption is kept.
    Mirroring,
}

/// Frames of a patch.
const PATCH: usize = 4;

impl Corruption {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Noise,
        Self::Shuffling,
        Self::Sliding,
        Self::Stills,
        Self::Jitter,
        Self::Steps,
        Self::Drift,
        Self::Speed,
        Self::Mirroring,
    ];

    /// The ones of copies in training. Gates ask for the others too, which no evaluator has learned.
    const LEARNED: [Self; 4] = [Self::Stills, Self::Jitter, Self::Steps, Self::Drift];

    /// The word in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Noise => "noise",
            Self::Shuffling => "shuffling",
            Self::Sliding => "sliding",
            Self::Stills => "stills",
            Self::Jitter => "jitter",
            Self::Steps => "boundary steps",
            Self::Drift => "root drift",
            Self::Speed => "speed",
            Self::Mirroring => "mirroring",
        }
    }

    /// Strengths, ascending; the last is the size at which a gate asks for it.
    pub fn strengths(self) -> &'static [f64] {
        match self {
            Self::Noise | Self::Shuffling => &[0.1, 0.3, 1.0],
            Self::Sliding => &[0.25, 0.5, 1.0],
            Self::Stills => &[0.1, 0.2],
            Self::Jitter => &[2.5, 5.0, 10.0],
            Self::Steps => &[5.0, 10.0, 20.0],
            Self::Drift => &[0.1, 0.2, 0.4],
            Self::Speed => &[1.15, 1.3],
            Self::Mirroring => &[1.0],
        }
    }

    /// Whether an evaluator that does not see it scores nothing.
    pub fn is_required(self) -> bool {
        !matches!(self, Self::Speed | Self::Mirroring)
    }

    /// A motion, `[T, 263]` row-major and raw, made worse.
    pub fn of(self, motion: &Motion, strength: f64, rng: &mut ChaCha8Rng) -> Vec<f32> {
        match self {
            Self::Noise => noisy(motion, strength, rng),
            Self::Shuffling => shuffled(motion, strength, rng),
            Self::Sliding => sliding(motion, strength),
            Self::Stills => joints::held(motion, strength, rng),
            Self::Jitter => joints::displaced(motion, strength, 1, rng),
            Self::Steps => joints::displaced(motion, strength, PATCH, rng),
            Self::Drift => joints::drifting(motion, strength, rng),
            Self::Speed => joints::faster(motion, strength),
            Self::Mirroring => mirror_features(motion.features),
        }
    }

    /// A motion made worse in a way that is drawn, between its least and its last strength.
    pub fn any(motion: &Motion, rng: &mut ChaCha8Rng) -> Vec<f32> {
        let corruption = Self::LEARNED[below(rng, Self::LEARNED.len())];
        let strengths = corruption.strengths();
        let (least, most) = (strengths[0], strengths[strengths.len() - 1]);
        corruption.of(motion, least + unit(rng) * (most - least), rng)
    }
}

fn noisy(motion: &Motion, deviations: f64, rng: &mut ChaCha8Rng) -> Vec<f32> {
    let stds = motion.stats.std.iter().cycle();
    let noise = std::iter::from_fn(|| Some(<[f64; 2]>::from(normal_pair(rng)))).flatten();
    let each = motion.features.iter().zip(stds).zip(noise);
    each.map(|((x, std), noise)| x + (noise * deviations) as f32 * std).collect()
}

/// The frames that are drawn take one another's places, in a circle.
fn shuffled(motion: &Motion, share: f64, rng: &mut ChaCha8Rng) -> Vec<f32> {
    let frames: Vec<&[f32]> = motion.features.chunks_exact(N_FEATURES).collect();
    let places = swapped(frames.len(), share, rng);
    places.into_iter().flat_map(|from| frames[from]).copied().collect()
}

fn sliding(motion: &Motion, metres_a_second: f64) -> Vec<f32> {
    let step = (metres_a_second / motion.fps) as f32;
    let Range { start, end } = VELOCITIES;
    let mut made = motion.features.to_vec();
    for frame in made.chunks_exact_mut(N_FEATURES) {
        frame[ROOT_FORWARD] += step;
        (start + 2..end).step_by(3).for_each(|forward| frame[forward] += step);
    }
    made
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::FeatureStats;
    use crate::motion::recover_joints;
    use rand_chacha::rand_core::SeedableRng;

    fn rng() -> ChaCha8Rng {
        ChaCha8Rng::seed_from_u64(0)
    }

    fn made(corruption: Corruption, strength: f64) -> (Vec<f32>, Vec<f32>) {
        let features: Vec<f32> = (0..40 * N_FEATURES).map(|i| (i / N_FEATURES) as f32).collect();
        let stats = FeatureStats { mean: vec![0.0; N_FEATURES], std: vec![0.5; N_FEATURES] };
        let motion = Motion { features: &features, stats: &stats, fps: 20.0, least: 4 };
        let made = corruption.of(&motion, strength, &mut rng());
        (features, made)
    }

    #[test]
    fn noise_has_the_deviation_that_is_asked_for() {
        let (features, made) = made(Corruption::Noise, 0.3);
        let squares: f64 = features.iter().zip(&made).map(|(a, b)| f64::from(a - b).powi(2)).sum();
        let deviation = (squares / made.len() as f64).sqrt();
        assert!((deviation - 0.15).abs() < 0.003, "{deviation}");
    }

    #[test]
    fn shuffling_keeps_frames_and_moves_as_many_as_asked_for() {
        for &share in Corruption::Shuffling.strengths() {
            let (features, made) = made(Corruption::Shuffling, share);
            let firsts = |values: &[f32]| -> Vec<f32> {
                values.chunks_exact(N_FEATURES).map(|frame| frame[0]).collect()
            };
            let (mut before, mut after) = (firsts(&features), firsts(&made));
            let moved = before.iter().zip(&after).filter(|(a, b)| a != b).count();
            assert_eq!(moved, (share * 40.0).round() as usize);
            before.sort_by(f32::total_cmp);
            after.sort_by(f32::total_cmp);
            assert_eq!(before, after);
        }
    }

    #[test]
    fn a_standing_body_slides_at_the_speed_that_is_asked_for() {
        let mut frame = vec![0.0; N_FEATURES];
        frame[3] = 1.0;
        let features = frame.repeat(21);
        let stats = FeatureStats { mean: vec![0.0; N_FEATURES], std: vec![1.0; N_FEATURES] };
        let motion = Motion { features: &features, stats: &stats, fps: 20.0, least: 4 };
        let joints = recover_joints(&Corruption::Sliding.of(&motion, 0.5, &mut rng()));
        // Twenty steps of a twentieth of a second.
        assert!((joints[20][0][2] - joints[0][0][2] - 0.5).abs() < 1e-5);
    }
}
