//! The text-motion matching networks of Guo et al. (2022), trained in one stage: convolutions that make
//! four frames one row, bidirectional GRUs, and a margin. Words are hashed n-grams in place of GloVe
//! vectors and parts of speech, and the convolutions are not trained as an autoencoder first.
//!
//! Shapes: n motions or pairs of r rows at most, f features, c channels, e numbers of an embedding.

mod recurrence;

use burn::module::Module;
use burn::tensor::activation::{leaky_relu, relu};
use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;

use recurrence::{Order, Reader, SLOPE};

use super::seen::{Networks, Pairs, Rows};
use crate::draws::unit;
use crate::learn::layers::{Affine, Conv1d};
use crate::spec::{EvaluatorSpec, MatchingSpec, Mismatches};

/// All parameters of an evaluator of this kind.
#[derive(Module, Debug)]
pub struct MatchingNetworks {
    movement: Movement,
    motion: Reader,
    caption: Reader,
    #[module(skip)]
    sizes: MatchingSpec,
}

impl MatchingNetworks {
    /// Draws parameters, for motions of `n_features` features a frame.
    pub fn init(
        spec: &EvaluatorSpec,
        sizes: &MatchingSpec,
        n_features: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let width = sizes.width;
        Self {
            movement: Movement::init(n_features, spec, sizes, rng, device),
            motion: Reader::init([width, 2 * width, spec.dim], rng, device),
            caption: Reader::init([spec.word_dim, width, spec.dim], rng, device),
            sizes: sizes.clone(),
        }
    }

    fn moved(&self, rows: &Rows, rng: Option<&mut ChaCha8Rng>) -> Tensor<2> {
        let order = Order::padded(&rows.lengths, self.movement.longest(rows));
        self.motion.read(self.movement.rows(rows, rng), &order)
    }
}

impl Networks for MatchingNetworks {
    fn motions(&self, rows: &Rows) -> Tensor<2> {
        self.moved(rows, None)
    }

    fn captions(&self, rows: &Rows) -> Tensor<2> {
        let n_rows = rows.lengths.iter().sum::<usize>();
        let shape = [n_rows, rows.values.len() / n_rows];
        let words = TensorData::new(rows.values.clone(), shape);
        let words = Tensor::from_data(words, &self.caption.device());
        self.caption.read(words, &Order::packed(&rows.lengths))
    }

    fn loss(&self, pairs: &Pairs, rng: Option<&mut ChaCha8Rng>) -> Tensor<1> {
        let motions = self.moved(&pairs.motions.and(&pairs.corrupted), rng);
        let captions = self.captions(&pairs.captions);
        let MatchingSpec { margin, mismatches, .. } = self.sizes;
        let (n, all) = (pairs.caption_ids.len(), motions.dims()[0]);
        let own = motions.clone().narrow(0, 0, n);
        let loss = margin_loss(&own, &captions, &pairs.caption_ids, margin, mismatches);
        if all == n {
            return loss;
        }
        loss + pushed_apart(motions.narrow(0, n, all - n), captions, margin) * CORRUPTED_SHARE
    }
}

// [`Movement`]: frames into rows, one of four frames.

/// Frames of a row.
const FRAMES: usize = 4;

/// Two convolutions, each of which halves the rate, and a layer.
#[derive(Module, Debug)]
struct Movement {
    first: Conv1d,
    second: Conv1d,
    output: Affine,
    #[module(skip)]
    dropout: f64,
    /// Rows that every motion is filled up to with frames of zeros, which the second convolution sees as the first
    /// makes them: Guo et al.'s way. `None` fills up to the longest motion, and motions do not see beyond their end.
    #[module(skip)]
    filled: Option<usize>,
}

impl Movement {
    /// From frames of `n_features` to rows of the spec's width.
    fn init(
        n_features: usize,
        spec: &EvaluatorSpec,
        &MatchingSpec { width, dropout, .. }: &MatchingSpec,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        Self {
            filled: spec.loaded.is_some().then_some(spec.window / FRAMES),
            first: Conv1d::halving([n_features, width], rng, device),
            second: Conv1d::halving([width, width], rng, device),
            output: Affine::new(width, width, rng, device),
            dropout,
        }
    }

    /// Rows that motions are filled up to.
    fn longest(&self, rows: &Rows) -> usize {
        self.filled.unwrap_or_else(|| rows.lengths.iter().copied().max().unwrap_or(0))
    }

    /// Rows of four frames each, `[n r, c]`; motions that have fewer rows than the longest are filled up.
    fn rows(&self, rows: &Rows, mut rng: Option<&mut ChaCha8Rng>) -> Tensor<2> {
        let (device, longest) = (self.output.device(), self.longest(rows));
        let x_ntf = frames(rows, longest, &device);
        let first = rectified(self.first.forward(x_ntf), self.dropout, rng.as_deref_mut());
        let first = match self.filled {
            Some(_) => first,
            // Rows beyond the end of a motion are zero, as beyond the longest.
            None => first * there(rows, longest, &device),
        };
        let second = rectified(self.second.forward(first), self.dropout, rng);
        let [n, r, c] = second.dims();
        self.output.forward(second.reshape([n * r, c]))
    }
}

/// Motions side by side, `[n, 4 r, f]`, filled up with zeros.
fn frames(rows: &Rows, longest: usize, device: &Device) -> Tensor<3> {
    let n = rows.lengths.len();
    let channels = rows.values.len() / rows.lengths.iter().sum::<usize>();
    let mut values = Vec::with_capacity(n * longest * channels);
    let mut start = 0;
    for (i, length) in rows.lengths.iter().enumerate() {
        values.extend_from_slice(&rows.values[start..start + length * channels]);
        values.resize((i + 1) * longest * channels, 0.0);
        start += length * channels;
    }
    let shape = [n, FRAMES * longest, channels / FRAMES];
    Tensor::from_data(TensorData::new(values, shape), device)
}

/// 1 if a motion has a frame at half the rate, else 0, `[n, 2 r, 1]`.
fn there(rows: &Rows, longest: usize, device: &Device) -> Tensor<3> {
    let halves = 2 * longest;
    let of = |length: &usize| {
        let own = 2 * length;
        (0..halves).map(move |half| f32::from(u8::from(half < own)))
    };
    let values: Vec<f32> = rows.lengths.iter().flat_map(of).collect();
    Tensor::from_data(TensorData::new(values, [rows.lengths.len(), halves, 1]), device)
}

/// The rectifier, after some channels are left out in training.
fn rectified(x: Tensor<3>, dropout: f64, rng: Option<&mut ChaCha8Rng>) -> Tensor<3> {
    let x = match rng {
        Some(rng) if dropout > 0.0 => {
            let (shape, device) = (x.dims(), x.device());
            let kept = (1.0 / (1.0 - dropout)) as f32;
            let values = (0..shape.iter().product())
                .map(|_| if unit(rng) < dropout { 0.0 } else { kept })
                .collect::<Vec<f32>>();
            x * Tensor::from_data(TensorData::new(values, shape), &device)
        }
        _ => x,
    };
    leaky_relu(x, SLOPE)
}

// The loss by which pairs are pulled together and pushed apart.

/// Weight of corrupted motions beside mismatches. With 1, R@1 on CMU and Bandai motion falls from 0.322 to 0.218.
const CORRUPTED_SHARE: f64 = 0.1;

/// Added to squared distances, whose root has no slope at 0.
const EPSILON: f64 = 1e-6;

/// Mean d² over pairs that match, and mean max(0, margin − d)² over pairs that do not, `[1]` (Hadsell et
/// al. 2006). Pairs with the same caption are no mismatches.
fn margin_loss(
    motions_ne: &Tensor<2>,
    captions_ne: &Tensor<2>,
    caption_ids: &[u32],
    margin: f64,
    mismatches: Mismatches,
) -> Tensor<1> {
    let squares_nn = squared_distances(motions_ne, captions_ne);
    let device = squares_nn.device();
    let n = caption_ids.len();
    let shares = TensorData::new(shares(caption_ids, mismatches), [n, n]);
    let own = Tensor::<2>::eye(n, &device) / n as f64;
    let apart = relu(squares_nn.clone().sqrt().neg().add_scalar(margin)).powi_scalar(2);
    (squares_nn * own).sum() + (apart * Tensor::from_data(shares, &device)).sum()
}

/// Mean max(0, margin − d)² of the first captions and as many corrupted motions, `[1]`: each caption and the motion that
/// would be its own.
fn pushed_apart(motions_me: Tensor<2>, captions_ne: Tensor<2>, margin: f64) -> Tensor<1> {
    let m = motions_me.dims()[0];
    let squares_m1 = (motions_me - captions_ne.narrow(0, 0, m)).powi_scalar(2).sum_dim(1);
    let distances_m1 = squares_m1.add_scalar(EPSILON).sqrt();
    relu(distances_m1.neg().add_scalar(margin)).powi_scalar(2).mean()
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

    #[test]
    fn a_corrupted_motion_is_pushed_from_its_own_caption_up_to_the_margin() {
        let device = Device::flex();
        let motions = Tensor::from_data([[0.0, 0.0], [9.0, 0.0]], &device);
        let captions = Tensor::from_data([[3.0, 4.0], [9.0, 12.0], [0.0, 0.0]], &device);
        let loss = f64::from(pushed_apart(motions, captions, 10.0).into_scalar::<f32>());
        assert!((loss - 25.0 / 2.0).abs() < 1e-3, "distances of 5 and 12: {loss}");
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
