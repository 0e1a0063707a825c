//! The reconstruction loss.
//!
//! Shapes: b clips, t frames, f features.

use burn::tensor::{Tensor, TensorData};

use crate::motion::POSITIONS;

/// Smooth L1 over all features, plus `position_weight` times smooth L1 over the positions, each a
/// mean over its own values (T2M-GPT's loss; it calls the positions "velocity"). `[1]`.
///
/// With d = prediction − target and g = clamp(d, −1, 1) one value's loss is g (d − g/2). Its
/// derivative in d is g even where g is held fixed, so g stays out of the graph.
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

/// What each feature counts for in a sum over all values, `[1, 1, f]`.
fn feature_weights(like_btf: &Tensor<3>, position_weight: f64) -> Tensor<3> {
    let [b, t, n_features] = like_btf.dims();
    let frames = (b * t) as f64;
    let positions = POSITIONS.start.min(n_features)..POSITIONS.end.min(n_features);
    let mut weights = vec![(1.0 / (frames * n_features as f64)) as f32; n_features];
    let extra = position_weight / (frames * positions.len().max(1) as f64);
    weights[positions].iter_mut().for_each(|weight| *weight += extra as f32);
    Tensor::from_data(TensorData::new(weights, [1, 1, n_features]), &like_btf.device())
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

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
        let grad = prediction.grad(&loss.backward()).unwrap().into_data();
        let grad = grad.try_into_vec::<f32>().unwrap();
        let expected = [0.4 / 70.0, -1.0 / 70.0, 0.0];
        assert!(grad.iter().zip(expected).all(|(g, e)| (g - e).abs() < 1e-7), "{grad:?}");
    }
}
