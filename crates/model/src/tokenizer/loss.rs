//! The loss of a tokenizer: the error of features, or of joints in metres.
//!
//! # The loss in joints
//!
//! With p the true and p̂ the predicted positions of the joints about the root, m the visible frames
//! and e the error of the root's half turns, summed over earlier frames,
//!
//! given = mean_m mean_j ‖p − p̂‖ / 0.1 m, own = mean_m mean_j ‖p − R(−2 Σe) p̂‖ / 0.1 m,
//! features = mean_m Σ_f w_f smooth L1, velocity = mean_m mean |Δp − Δp̂| / 0.02 m,
//!
//! loss = ½ (given + own) + feature_weight · features + velocity_weight · velocity,
//!
//! and the terms of [`course`] over time, where they have a weight.
//!
//! The gradient is computed on the host in one pass: composed of tensor operations, the loss would take longer than the
//! network.
//!
//! Shapes: b clips, t frames, f features.

mod course;

use burn::tensor::{Tensor, TensorData};

use super::corpus::Normaliser;
use super::windows::Windows;
use crate::motion::{POSITIONS, ROOT_YAW};
use crate::spec::TokenizerTraining;
use course::{CourseLoss, DISTANCE_M, JOINTS, Point, length};

/// Smooth L1 over all features, plus `position_weight` times smooth L1 over the positions, each a
/// mean over its own values (T2M-GPT's loss; it calls the positions "velocity"). `[1]`.
///
/// With d = prediction − target and g = clamp(d, −1, 1) one value's loss is g (d − g/2). Its
/// derivative in d is g even if g is constant, so g stays out of the graph.
pub fn reconstruction_loss(
    prediction_btf: Tensor<3>,
    target_btf: Tensor<3>,
    position_weight: f64,
) -> Tensor<1> {
    let apart_btf = prediction_btf - target_btf;
    let clamped_btf = apart_btf.clone().inner().clamp(-1.0, 1.0);
    let weights = feature_weights(&clamped_btf, position_weight);
    let weighted_btf = Tensor::from_inner(clamped_btf.clone() * weights);
    ((apart_btf - Tensor::from_inner(clamped_btf * 0.5)) * weighted_btf).sum()
}

/// The weight of each feature in a sum over all values, `[1, 1, f]`.
fn feature_weights(like_btf: &Tensor<3>, position_weight: f64) -> Tensor<3> {
    let [b, t, n_features] = like_btf.dims();
    let frames = (b * t) as f64;
    let positions = POSITIONS.start.min(n_features)..POSITIONS.end.min(n_features);
    let mut weights = vec![(1.0 / (frames * n_features as f64)) as f32; n_features];
    let extra = position_weight / (frames * positions.len().max(1) as f64);
    weights[positions].iter_mut().for_each(|weight| *weight += extra as f32);
    Tensor::from_data(TensorData::new(weights, [1, 1, n_features]), &like_btf.device())
}

/// A loss as a tensor: its value, and its gradient by the prediction, both of which were computed on
/// the host.
pub fn of_gradient(prediction_btf: Tensor<3>, value: f64, gradient: Vec<f32>) -> Tensor<1> {
    let data = TensorData::new(gradient, prediction_btf.dims());
    let gradient_btf = Tensor::from_data(data, &prediction_btf.device());
    let linear = (prediction_btf * gradient_btf).sum();
    let constant = linear.clone().detach();
    // The difference is exactly 0: the value is the loss's, the gradient the one given.
    (linear - constant) + value
}

/// Metres a frame that count as one.
const VELOCITY_M: f64 = 0.02;
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
    /// `None` if neither of its terms has a weight.
    course: Option<CourseLoss>,
}

impl JointLoss {
    /// The loss with the weights of a training.
    pub fn new(normaliser: Normaliser, training: &TokenizerTraining) -> Self {
        let mut shares = vec![1.0; normaliser.n_features()];
        shares[..POSITIONS.start].fill(ROOT);
        shares[ROOT_YAW] = TURN;
        let all: f64 = shares.iter().sum();
        shares.iter_mut().for_each(|share| *share /= all);
        let TokenizerTraining { feature_weight, velocity_weight, .. } = *training;
        let course = CourseLoss::new(&normaliser, training);
        Self { normaliser, feature_weight, velocity_weight, shares, course }
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
            if let Some(course) = &self.course {
                let n_visible = visible.iter().take_while(|visible| **visible).count();
                loss += share * course.of([made, truth], n_visible, share, gradient);
            }
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
        // The derivative of a frame's loss by the heading error.
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

    /// The position of a joint about the root, in metres.
    fn position(&self, frame: &[f32], joint: usize) -> Point {
        std::array::from_fn(|i| {
            let column = POSITIONS.start + 3 * joint + i;
            let (mean, std) = (self.normaliser.mean[column], self.normaliser.std[column]);
            f64::from(frame[column]) * f64::from(std) + f64::from(mean)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    use crate::data::FeatureStats;
    use crate::motion::N_FEATURES;
    use crate::spec::{ArchitectureSpec, PatchSpec, TokenizerSpec};
    use crate::tokenizer::halves::host;

    /// One frame of 70 features, all 0 but a few.
    fn frame(set: &[(usize, f32)]) -> Tensor<3> {
        let mut values = vec![0.0f32; 70];
        set.iter().for_each(|&(feature, value)| values[feature] = value);
        let device = Device::flex().autodiff();
        Tensor::from_data(TensorData::new(values, [1, 1, 70]), &device)
    }

    #[test]
    fn small_errors_count_by_their_square_and_large_ones_by_their_size() {
        let loss = |error| reconstruction_loss(frame(&[(0, error)]), frame(&[]), 0.5);
        assert!((loss(0.4).into_scalar::<f32>() - 0.08 / 70.0).abs() < 1e-7);
        assert!((loss(-3.0).into_scalar::<f32>() - 2.5 / 70.0).abs() < 1e-7);
    }

    #[test]
    fn positions_count_more() {
        let loss = |feature| reconstruction_loss(frame(&[(feature, 2.0)]), frame(&[]), 0.5);
        let extra = loss(66).into_scalar::<f32>() - loss(67).into_scalar::<f32>();
        assert!((extra - 0.5 * 1.5 / 63.0).abs() < 1e-7, "{extra}");
    }

    #[test]
    fn the_gradient_is_that_of_smooth_l1() {
        let prediction = frame(&[(0, 0.4), (1, -3.0)]).require_grad();
        let loss = reconstruction_loss(prediction.clone(), frame(&[]), 0.5);
        let grad = host(prediction.grad(&loss.backward()).unwrap());
        let expected = [0.4 / 70.0, -1.0 / 70.0, 0.0];
        assert!(grad.iter().zip(expected).all(|(g, e)| (g - e).abs() < 1e-7), "{grad:?}");
    }

    pub const FRAMES: usize = 5;

    pub fn normaliser() -> Normaliser {
        let stats = FeatureStats {
            mean: (0..N_FEATURES).map(|i| (i as f32 * 0.7).sin() * 0.2).collect(),
            std: (0..N_FEATURES).map(|i| 0.1 + 0.01 * (i % 7) as f32).collect(),
        };
        let architecture = ArchitectureSpec::Patch(PatchSpec::default());
        let spec = TokenizerSpec { architecture, ..TokenizerSpec::default() };
        Normaliser::new(&spec, &stats)
    }

    fn loss() -> JointLoss {
        JointLoss::new(normaliser(), &TokenizerTraining::of_patches())
    }

    /// Two windows.
    fn windows(values: &[f32], visible: Vec<bool>) -> Windows {
        Windows { values: values.to_vec(), visible, n_frames: FRAMES, clips: vec![0; 2] }
    }

    pub fn values(phase: f32) -> Vec<f32> {
        (0..2 * FRAMES * N_FEATURES).map(|i| (i as f32 * 0.37 + phase).sin()).collect()
    }

    #[test]
    fn the_gradient_is_that_of_differences() {
        let (loss, truth) = (loss(), values(0.0));
        let mut visible = vec![true; 2 * FRAMES];
        (visible[FRAMES - 1], visible[FRAMES + 3]) = (false, false);
        let windows = windows(&truth, visible);
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
        let (value, gradient) = loss.of(&made, &windows(&truth, visible));
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
        let (value, gradient) = loss.of(&made, &windows(&truth, visible));
        assert!(value > 0.02 && gradient[ROOT_YAW] > 0.0, "{value} {}", gradient[ROOT_YAW]);
        let last = (FRAMES - 1) * N_FEATURES + ROOT_YAW;
        assert!(gradient[last].abs() < 1e-6, "no frame comes after it");
    }
}
