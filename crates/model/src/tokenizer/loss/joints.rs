//! The loss in joints: how far they are off, in metres, as a person would see it.
//!
//! With p the true and p̂ the predicted positions of the joints about the root, m the visible frames
//! and e the error of the root's half turns, summed over the frames before,
//!
//! given = mean_m mean_j ‖p − p̂‖ / 0.1 m, own = mean_m mean_j ‖p − R(−2 Σe) p̂‖ / 0.1 m,
//! features = mean_m Σ_f w_f smooth L1, velocity = mean_m mean |Δp − Δp̂| / 0.02 m,
//!
//! loss = ½ (given + own) + feature_weight · features + velocity_weight · velocity.
//!
//! The gradient is written out and computed on the host in one pass: composed of tensor operations the
//! loss would take longer than the network.

use crate::motion::{POSITIONS, ROOT_YAW};
use crate::spec::TokenizerTraining;
use crate::tokenizer::normalise::Normaliser;
use crate::tokenizer::windows::Windows;

const JOINTS: usize = (POSITIONS.end - POSITIONS.start) / 3;
/// Metres that count as one.
const DISTANCE_M: f64 = 0.1;
/// Metres a frame that count as one.
const VELOCITY_M: f64 = 0.02;
/// Keeps the distance's gradient finite where it is 0, in m².
const SOFTENING_M2: f64 = 1e-6;
/// How much the turn, the rest of the root and each other feature count for.
const TURN: f64 = 12.0;
const ROOT: f64 = 6.0;

/// The loss in joints of normalised features.
pub struct JointLoss {
    normaliser: Normaliser,
    feature_weight: f64,
    velocity_weight: f64,
    /// Weight of each feature; together 1.
    shares: Vec<f64>,
}

type Point = [f64; 3];

impl JointLoss {
    /// The loss with the weights of a training.
    pub fn new(normaliser: Normaliser, training: &TokenizerTraining) -> Self {
        let mut shares = vec![1.0; normaliser.n_features()];
        shares[..POSITIONS.start].fill(ROOT);
        shares[ROOT_YAW] = TURN;
        let all: f64 = shares.iter().sum();
        shares.iter_mut().for_each(|share| *share /= all);
        let TokenizerTraining { feature_weight, velocity_weight, .. } = *training;
        Self { normaliser, feature_weight, velocity_weight, shares }
    }

    /// The loss of predicted windows, and its gradient by each of their values.
    pub fn of(&self, made: &[f32], truth: &Windows) -> (f64, Vec<f32>) {
        let size = truth.n_frames * self.normaliser.n_features();
        let n_visible = truth.n_visible() as f64;
        let mut gradient = vec![0.0; made.len()];
        let (mut loss, share) = (0.0, 1.0 / n_visible);
        let windows = made.chunks_exact(size).zip(truth.values.chunks_exact(size));
        let visible = truth.visible.chunks_exact(truth.n_frames);
        for (((made, truth), visible), gradient) in
            windows.zip(visible).zip(gradient.chunks_exact_mut(size))
        {
            loss += share * self.features(made, truth, visible, share, gradient);
            loss += share * self.joints(made, truth, visible, share, gradient);
        }
        (loss, gradient)
    }

    fn features(
        &self,
        made: &[f32],
        truth: &[f32],
        visible: &[bool],
        share: f64,
        gradient: &mut [f32],
    ) -> f64 {
        let n = self.normaliser.n_features();
        let mut sum = 0.0;
        let frames = made.chunks_exact(n).zip(truth.chunks_exact(n));
        for (((made, truth), visible), gradient) in
            frames.zip(visible).zip(gradient.chunks_exact_mut(n))
        {
            if !visible {
                continue;
            }
            let values = made.iter().zip(truth).zip(&self.shares).zip(gradient);
            for (((made, truth), weight), gradient) in values {
                let apart = f64::from(made - truth);
                let clamped = apart.clamp(-1.0, 1.0);
                let weight = weight * self.feature_weight;
                sum += weight * clamped * (apart - 0.5 * clamped);
                *gradient += (weight * share * clamped) as f32;
            }
        }
        sum
    }

    fn joints(
        &self,
        made: &[f32],
        truth: &[f32],
        visible: &[bool],
        share: f64,
        gradient: &mut [f32],
    ) -> f64 {
        let n = self.normaliser.n_features();
        let turn_std = f64::from(self.normaliser.std[ROOT_YAW]);
        let (mut sum, mut angle) = (0.0, 0.0);
        // What the loss of a frame grows by with the error of the heading there.
        let mut by_angle = vec![0.0; visible.len()];
        let mut before: Option<[Point; JOINTS]> = None;
        for (t, &visible) in visible.iter().enumerate() {
            let (made, truth) = (&made[t * n..][..n], &truth[t * n..][..n]);
            let earlier = before.take();
            if visible {
                let mut slopes = [[0.0; 3]; JOINTS];
                let apart;
                (apart, by_angle[t]) = self.frame(made, truth, angle, &mut slopes, &mut sum);
                if let Some(earlier) = earlier {
                    let mut slopes_earlier = [[0.0; 3]; JOINTS];
                    let slopes = [&mut slopes_earlier, &mut slopes];
                    sum += self.velocity(&earlier, &apart, slopes);
                    self.spread(&slopes_earlier, share, &mut gradient[(t - 1) * n..t * n]);
                }
                self.spread(&slopes, share, &mut gradient[t * n..][..n]);
                before = Some(apart);
            }
            angle += f64::from(made[ROOT_YAW] - truth[ROOT_YAW]) * turn_std;
        }
        // The turn of a frame moves the heading of all later ones.
        let mut later = 0.0;
        for (t, slope) in by_angle.into_iter().enumerate().rev() {
            gradient[t * n + ROOT_YAW] += (later * turn_std * share) as f32;
            later += slope;
        }
        sum
    }

    /// Adds the two distances of a frame to `sum`, and their slopes by the predicted positions to
    /// `slopes`; gives predicted minus true positions, and the slope by the heading.
    fn frame(
        &self,
        made: &[f32],
        truth: &[f32],
        angle: f64,
        slopes: &mut [Point; JOINTS],
        sum: &mut f64,
    ) -> ([Point; JOINTS], f64) {
        let weight = 0.5 / (DISTANCE_M * JOINTS as f64);
        let (sin, cos) = (-2.0 * angle).sin_cos();
        let (mut apart, mut by_angle) = ([[0.0; 3]; JOINTS], 0.0);
        for (joint, (apart, slope)) in apart.iter_mut().zip(slopes).enumerate() {
            let (made, truth) = (self.position(made, joint), self.position(truth, joint));
            *apart = std::array::from_fn(|i| made[i] - truth[i]);
            let given = length(apart);
            let [x, y, z] = made;
            let turned = [cos * x + sin * z, y, cos * z - sin * x];
            let off: Point = std::array::from_fn(|i| turned[i] - truth[i]);
            let own = length(&off);
            *sum += weight * (given + own);
            let g = off.map(|d| d / own);
            let back = [cos * g[0] - sin * g[2], g[1], sin * g[0] + cos * g[2]];
            for i in 0..3 {
                slope[i] += weight * (apart[i] / given + back[i]);
            }
            // d turned / d angle, with the angle's −2 in it.
            let [dx, dz] = [2.0 * (sin * x - cos * z), 2.0 * (cos * x + sin * z)];
            by_angle += weight * (g[0] * dx + g[2] * dz);
        }
        (apart, by_angle)
    }

    /// The loss of velocities between two frames of differences; adds its slopes by both.
    fn velocity(
        &self,
        before: &[Point; JOINTS],
        now: &[Point; JOINTS],
        [of_before, of_now]: [&mut [Point; JOINTS]; 2],
    ) -> f64 {
        let weight = self.velocity_weight / (VELOCITY_M * (3 * JOINTS) as f64);
        let mut sum = 0.0;
        for (joint, i) in (0..JOINTS).flat_map(|joint| [(joint, 0), (joint, 1), (joint, 2)]) {
            let off = now[joint][i] - before[joint][i];
            sum += weight * off.abs();
            let slope = if off == 0.0 { 0.0 } else { weight * off.signum() };
            of_now[joint][i] += slope;
            of_before[joint][i] -= slope;
        }
        sum
    }

    /// Slopes by positions in metres into those by normalised values.
    fn spread(&self, slopes: &[Point; JOINTS], share: f64, gradient: &mut [f32]) {
        let std = &self.normaliser.std[POSITIONS];
        let slopes = slopes.as_flattened().iter().zip(std);
        for (gradient, (slope, std)) in gradient[POSITIONS].iter_mut().zip(slopes) {
            *gradient += (slope * share * f64::from(*std)) as f32;
        }
    }

    /// Of a joint about the root, in metres.
    fn position(&self, frame: &[f32], joint: usize) -> Point {
        std::array::from_fn(|i| {
            let column = POSITIONS.start + 3 * joint + i;
            let (mean, std) = (self.normaliser.mean[column], self.normaliser.std[column]);
            f64::from(frame[column]) * f64::from(std) + f64::from(mean)
        })
    }
}

fn length(apart: &Point) -> f64 {
    (apart.iter().map(|d| d * d).sum::<f64>() + SOFTENING_M2).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::FeatureStats;
    use crate::motion::N_FEATURES;
    use crate::spec::{ArchitectureSpec, PatchSpec, TokenizerSpec};

    const FRAMES: usize = 5;

    fn loss() -> JointLoss {
        let stats = FeatureStats {
            mean: (0..N_FEATURES).map(|i| (i as f32 * 0.7).sin() * 0.2).collect(),
            std: (0..N_FEATURES).map(|i| 0.1 + 0.01 * (i % 7) as f32).collect(),
        };
        let architecture = ArchitectureSpec::Patch(PatchSpec::default());
        let spec = TokenizerSpec { architecture, ..TokenizerSpec::default() };
        let normaliser = Normaliser::new(&spec, &stats);
        JointLoss::new(normaliser, &TokenizerTraining::of_patches())
    }

    fn values(phase: f32) -> Vec<f32> {
        (0..2 * FRAMES * N_FEATURES).map(|i| (i as f32 * 0.37 + phase).sin()).collect()
    }

    #[test]
    fn the_gradient_is_that_of_differences() {
        let (loss, truth) = (loss(), values(0.0));
        let mut visible = vec![true; 2 * FRAMES];
        (visible[FRAMES - 1], visible[FRAMES + 3]) = (false, false);
        let windows = Windows {
            values: truth.clone(),
            visible: visible.clone(),
            n_frames: FRAMES,
            clips: vec![0; 2],
        };
        let made = values(1.3);
        let (_, gradient) = loss.of(&made, &windows);
        let columns = [ROOT_YAW, 1, 3, 4, 5, 6, 30, 66, 70, 262];
        for (frame, column) in (0..2 * FRAMES).flat_map(|t| columns.map(|c| (t, c))) {
            let at = frame * N_FEATURES + column;
            let shifted = |by: f32| {
                let mut made = made.clone();
                made[at] += by;
                loss.of(&made, &windows).0
            };
            let slope = (shifted(1e-3) - shifted(-1e-3)) / 2e-3;
            let found = f64::from(gradient[at]);
            assert!(
                (slope - found).abs() < 2e-4 + 0.01 * slope.abs(),
                "{frame} {column}: {slope} {found}"
            );
        }
    }

    #[test]
    fn what_is_not_visible_and_what_is_right_cost_nothing() {
        let (loss, truth) = (loss(), values(0.0));
        let mut made = truth.clone();
        made[4 * N_FEATURES..5 * N_FEATURES].fill(9.0);
        let mut visible = vec![true; 2 * FRAMES];
        visible[4] = false;
        let windows = Windows {
            values: truth.clone(),
            visible: visible.clone(),
            n_frames: FRAMES,
            clips: vec![0; 2],
        };
        let (value, gradient) = loss.of(&made, &windows);
        // A distance of 0 counts as 1 mm, softened so that it has a slope.
        assert!((value - 0.01).abs() < 1e-6, "{value}");
        assert!(gradient.iter().all(|slope| slope.abs() < 1e-6));
    }

    #[test]
    fn a_wrong_heading_costs_what_it_moves() {
        let (loss, truth) = (loss(), vec![0.0; 2 * FRAMES * N_FEATURES]);
        let mut made = truth.clone();
        made[ROOT_YAW] = 1.0;
        let visible = vec![true; 2 * FRAMES];
        let windows = Windows {
            values: truth.clone(),
            visible: visible.clone(),
            n_frames: FRAMES,
            clips: vec![0; 2],
        };
        let (value, gradient) = loss.of(&made, &windows);
        assert!(value > 0.02 && gradient[ROOT_YAW] > 0.0, "{value} {}", gradient[ROOT_YAW]);
        let last = (FRAMES - 1) * N_FEATURES + ROOT_YAW;
        assert!(gradient[last].abs() < 1e-6, "no frame comes after it");
    }
}
