//! [`margin_loss`]: the loss by which pairs are pulled together and pushed apart.
//!
//! Shapes: n pairs, e numbers of an embedding.

use burn::tensor::activation::relu;
use burn::tensor::{Tensor, TensorData};

use crate::spec::Mismatches;

/// Added to squared distances, whose root has no slope at 0.
const EPSILON: f64 = 1e-6;

/// Mean d² over pairs that match, and mean max(0, margin − d)² over pairs that do not, `[1]` (Hadsell et
/// al. 2006). Pairs with the same caption are no mismatches.
pub fn margin_loss(
    motions_ne: &Tensor<2>,
    captions_ne: &Tensor<2>,
    caption_ids: &[u32],
    margin: f64,
    mismatches: Mismatches,
) -> Tensor<1> {
    let squares_nn = squared_distances(motions_ne, captions_ne);
    let device = squares_nn.device();
    let n = caption_ids.len();
    let weights =
        |values: Vec<f32>| Tensor::<2>::from_data(TensorData::new(values, [n, n]), &device);
    let own = Tensor::<2>::eye(n, &device) / n as f64;
    let apart = relu(squares_nn.clone().sqrt().neg().add_scalar(margin)).powi_scalar(2);
    (squares_nn * own).sum() + (apart * weights(shares(caption_ids, mismatches))).sum()
}

/// |mᵢ − cⱼ|² + ε, `[n, n]`.
fn squared_distances(motions_ne: &Tensor<2>, captions_ne: &Tensor<2>) -> Tensor<2> {
    let squares = |x: &Tensor<2>| x.clone().powi_scalar(2).sum_dim(1);
    let products = motions_ne.clone().matmul(captions_ne.clone().transpose());
    let sums = squares(motions_ne) + squares(captions_ne).transpose();
    (sums - products * 2.0).clamp_min(0.0).add_scalar(EPSILON)
}

/// The share of each motion and caption in the mean over mismatches, `[n, n]` row-major.
fn shares(caption_ids: &[u32], mismatches: Mismatches) -> Vec<f32> {
    let n = caption_ids.len();
    let counts = |i: usize, j: usize| {
        let chosen = match mismatches {
            Mismatches::Shifted => j == (i + 1) % n,
            Mismatches::All => true,
        };
        chosen && caption_ids[i] != caption_ids[j]
    };
    let of = |i: usize| (0..n).map(move |j| f32::from(u8::from(counts(i, j))));
    let counted: Vec<f32> = (0..n).flat_map(of).collect();
    let all: f32 = counted.iter().sum();
    counted.into_iter().map(|one| one / all.max(1.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    fn loss(motions: [[f32; 2]; 3], captions: [[f32; 2]; 3], ids: [u32; 3]) -> [f64; 2] {
        let device = Device::flex();
        let [motions, captions] = [motions, captions].map(|v| Tensor::from_data(v, &device));
        [Mismatches::Shifted, Mismatches::All].map(|mismatches| {
            let loss = margin_loss(&motions, &captions, &ids, 10.0, mismatches);
            f64::from(loss.into_scalar::<f32>())
        })
    }

    fn is_near(found: [f64; 2], expected: [f64; 2]) -> bool {
        found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 2e-3)
    }

    /// By hand: motions at 0, 3 and 30 on a line, captions at 1, 3 and 26.
    #[test]
    fn it_is_the_mean_of_squares_on_either_side_of_the_margin() {
        let [motions, captions] =
            [[[0.0, 0.0], [3.0, 0.0], [30.0, 0.0]], [[1.0, 0.0], [3.0, 0.0], [26.0, 0.0]]];
        let own = (1.0 + 0.0 + 16.0) / 3.0;
        // Distances 3, 23 and 29 of each motion from the next caption.
        let shifted = (49.0 + 0.0 + 0.0) / 3.0;
        // And 26, 2 and 27 from the one before.
        let all = (49.0 + 64.0) / 6.0;
        let found = loss(motions, captions, [0, 1, 2]);
        assert!(is_near(found, [own + shifted, own + all]), "{found:?}");
        let same = loss(motions, captions, [0, 0, 2]);
        assert!(is_near(same, [own, own]), "the two near ones share a caption: {same:?}");
        assert!(is_near(loss(motions, captions, [7; 3]), [own, own]));
    }
}
