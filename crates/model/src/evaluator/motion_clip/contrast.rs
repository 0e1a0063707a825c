//! [`contrast`]: the loss by which pairs find one another.
//!
//! Shapes: n pairs, e numbers of an embedding.

use burn::tensor::activation::log_softmax;
use burn::tensor::{Bool, Device, Tensor, TensorData};

/// Cosines are multiplied by 100 at most (Radford et al. 2021).
const MOST_SCALE: f64 = 100.0;

/// What stands for −∞ where a pair is left out.
const LEFT_OUT: f64 = -1e9;

/// Symmetric InfoNCE of unit vectors, `[n, e]` each, in nats, `[1]`: the mean cross-entropy of finding a
/// motion's caption among those of the batch, and a caption's motion.
///
/// Pairs with the same caption are no wrong answers: they are left out, but for one's own.
pub fn contrast(
    motions_ne: Tensor<2>,
    captions_ne: Tensor<2>,
    log_scale: Tensor<1>,
    caption_ids: &[u32],
) -> Tensor<1> {
    let (n, device) = (caption_ids.len(), motions_ne.device());
    let scale = log_scale.clamp_max(MOST_SCALE.ln()).exp().unsqueeze::<2>();
    let cosines_nn = motions_ne.matmul(captions_ne.transpose());
    let logits_nn = cosines_nn.mul(scale).mask_fill(same(caption_ids, &device), LEFT_OUT);
    let own_nn = Tensor::<2>::eye(n, &device);
    let cross_entropy =
        |logits_nn| (log_softmax(logits_nn, 1) * own_nn.clone()).sum().neg() / n as f64;
    (cross_entropy(logits_nn.clone()) + cross_entropy(logits_nn.transpose())) * 0.5
}

/// Which pairs have the same caption, and are not the same pair.
fn same(caption_ids: &[u32], device: &Device) -> Tensor<2, Bool> {
    let n = caption_ids.len();
    let of = |i: usize| (0..n).map(move |j| i != j && caption_ids[i] == caption_ids[j]);
    let values: Vec<bool> = (0..n).flat_map(of).collect();
    Tensor::from_data(TensorData::new(values, [n, n]), device)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn loss(motions: [[f32; 2]; 3], captions: [[f32; 2]; 3], ids: [u32; 3]) -> f64 {
        let device = Device::flex();
        let [motions, captions] = [motions, captions].map(|v| Tensor::from_data(v, &device));
        let log_scale = Tensor::from_data([2f32.ln()], &device);
        f64::from(contrast(motions, captions, log_scale, &ids).into_scalar::<f32>())
    }

    /// By hand: cosines 1, 0 and −1, times 2.
    #[test]
    fn it_is_the_mean_cross_entropy_of_both_directions() {
        let [right, up, left] = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]];
        let found = loss([right, up, left], [right, up, left], [0, 1, 2]);
        let e = |x: f64| x.exp();
        let at_the_ends = (e(2.0) + e(0.0) + e(-2.0)).ln() - 2.0;
        let between = (e(2.0) + 2.0 * e(0.0)).ln() - 2.0;
        assert!((found - (2.0 * at_the_ends + between) / 3.0).abs() < 1e-6, "{found}");
        assert!((loss([up; 3], [up; 3], [0, 1, 2]) - 3f64.ln()).abs() < 1e-6);
    }

    #[test]
    fn pairs_of_the_same_caption_are_no_wrong_answers() {
        let up = [0.0, 1.0];
        assert!(loss([up; 3], [up; 3], [7, 7, 7]).abs() < 1e-6);
        let two = (2.0 * 2f64.ln() + 3f64.ln()) / 3.0;
        assert!((loss([up; 3], [up; 3], [7, 7, 1]) - two).abs() < 1e-6);
    }
}
