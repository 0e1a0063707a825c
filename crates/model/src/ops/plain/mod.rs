//! The same operations composed of burn's: for every device, slower on the CPU, and the reference for the kernels of
//! [`own`](super::own).
//!
//! Shapes: n rows, d features, f hidden features, v vocabulary, b sequences, h heads, t positions
//! of the longest sequence, c features of a head.

mod attention;

use burn::tensor::activation::{log_softmax, relu, silu};
use burn::tensor::{FloatDType, Tensor};

use super::padded::integers;
use super::{Activation, AdamWStep, Convolution, FeedForwardWeights, HeadWeights, RowLosses, Taps};

pub use attention::{Joining, KeyValues, attend, attention_half, cross_attend};

/// How matrices are multiplied.
#[derive(Clone, Copy)]
pub enum Product {
    Single,
    /// The operands are rounded to a smaller type, and the result is widened again.
    In(FloatDType),
}

impl Product {
    fn of<const D: usize>(self, left: Tensor<D>, right: Tensor<D>) -> Tensor<D> {
        match self {
            Product::Single => left.matmul(right),
            Product::In(dtype) => left.cast(dtype).matmul(right.cast(dtype)).cast(FloatDType::F32),
        }
    }
}

/// See [`Kernels::feed_forward`](super::Kernels::feed_forward).
pub fn feed_forward_half(
    x_nd: Tensor<2>,
    weights: FeedForwardWeights,
    activation: Activation,
    epsilon: f32,
    product: Product,
) -> Tensor<2> {
    let before_nu = product.of(rms_norm(x_nd.clone(), weights.gamma_d, epsilon), weights.up_du);
    let hidden_nf = match activation {
        Activation::SwiGlu => swiglu(before_nu),
        Activation::Gelu => gelu(before_nu),
    };
    x_nd + product.of(hidden_nf, weights.down_fd)
}

/// See [`Kernels::logits`](super::Kernels::logits).
pub fn logits(x_sd: Tensor<2>, weights: HeadWeights, epsilon: f32, product: Product) -> Tensor<2> {
    product.of(rms_norm(x_sd, weights.gamma_d, epsilon), weights.weight_dv)
}

/// See [`adamw`](super::adamw).
pub fn adamw(
    value: Tensor<1>,
    gradient: Tensor<1>,
    [first, second]: [Tensor<1>; 2],
    step: AdamWStep,
) -> (Tensor<1>, [Tensor<1>; 2]) {
    let gradient = gradient * step.clip;
    let first = first * step.beta_1 + gradient.clone() * (1.0 - step.beta_1);
    let second = second * step.beta_2 + gradient.clone() * gradient * (1.0 - step.beta_2);
    let move_by = first.clone() / (second.clone().sqrt() * step.scale + step.epsilon) * step.rate;
    (value * step.keep - move_by, [first, second])
}

/// y = x γ / √(mean(x²) + ε).
pub fn rms_norm(x_nd: Tensor<2>, gamma_d: Tensor<1>, epsilon: f32) -> Tensor<2> {
    let mean_square_n1 = x_nd.clone().powi_scalar(2).mean_dim(1);
    let rms_n1 = mean_square_n1.add_scalar(epsilon).sqrt();
    x_nd.div(rms_n1).mul(gamma_d.unsqueeze())
}

/// See [`Activation::SwiGlu`].
pub fn swiglu(gate_up_n2f: Tensor<2>) -> Tensor<2> {
    let [n, columns] = gate_up_n2f.dims();
    let gate_nf = gate_up_n2f.clone().slice([0..n, 0..columns / 2]);
    let up_nf = gate_up_n2f.slice([0..n, columns / 2..columns]);
    silu(gate_nf).mul(up_nf)
}

/// See [`Activation::Gelu`].
///
/// Composed, since the derivative of burn's own is that of the tanh approximation on every backend
/// but `flex`, 5e-4 off its value.
fn gelu(x_nf: Tensor<2>) -> Tensor<2> {
    let phi_nf = x_nf.clone().div_scalar(std::f64::consts::SQRT_2).erf().add_scalar(1.0) * 0.5;
    x_nf * phi_nf
}

/// See [`Kernels::select_rows`](super::Kernels::select_rows).
pub fn select_rows(x_md: Tensor<2>, rows: &[u32]) -> Tensor<2> {
    let device = x_md.device();
    x_md.select(0, integers(rows.iter().copied(), &device))
}

/// Mean cross-entropy of the rows' softmax, in nats.
pub fn cross_entropy(logits_nv: Tensor<2>, targets: &[u32]) -> Tensor<1> {
    log_likelihoods(logits_nv, targets).mean().neg()
}

/// Cross-entropy and likeliest column of each row.
pub fn nll(logits_nv: Tensor<2>, targets: &[u32]) -> RowLosses {
    let logits_nv = logits_nv.without_autodiff();
    let likeliest = logits_nv.clone().argmax(1).into_data();
    let data = log_likelihoods(logits_nv, targets).into_data();
    RowLosses {
        nats: data.iter::<f64>().map(|log_likelihood| -log_likelihood).collect(),
        likeliest: likeliest.iter::<i64>().map(|id| id as u32).collect(),
    }
}

/// ln p(target) of each row: `[n, 1]`.
fn log_likelihoods(logits_nv: Tensor<2>, targets: &[u32]) -> Tensor<2> {
    let targets_n = integers(targets.iter().copied(), &logits_nv.device());
    log_softmax(logits_nv, 1).gather(1, targets_n.unsqueeze_dim(1))
}

// Convolutions over frames: the inputs of the taps are concatenated, and multiplied once.

/// See [`Kernels::convolve`](super::Kernels::convolve).
pub fn convolve(
    x_nc: Tensor<2>,
    weight: Tensor<2>,
    bias_o: Tensor<1>,
    Convolution { n_clips, taps, rectify }: Convolution,
    product: Product,
) -> Tensor<2> {
    let [n, c] = x_nc.dims();
    let x_btc = if rectify { relu(x_nc) } else { x_nc }.reshape([n_clips, n / n_clips, c]);
    let read_btk = match taps {
        Taps::Point => x_btc,
        Taps::Neighbours(dilation) => neighbours(x_btc, dilation),
        Taps::Halving => fours(x_btc),
        Taps::Doubling => neighbours(upsample(x_btc), 1),
    };
    let [b, t, kc] = read_btk.dims();
    product.of(read_btk.reshape([b * t, kc]), weight) + bias_o.unsqueeze()
}

/// Each frame twice: nearest upsampling, `[b, t, c]` to `[b, 2t, c]`.
fn upsample(x_btc: Tensor<3>) -> Tensor<3> {
    let [b, t, c] = x_btc.dims();
    Tensor::cat(vec![x_btc.clone(), x_btc], 2).reshape([b, 2 * t, c])
}

/// `[b, t, 3c]`: the frames at −dilation, 0 and +dilation.
fn neighbours(x_btc: Tensor<3>, dilation: usize) -> Tensor<3> {
    let t = x_btc.dims()[1];
    let padded = pad_frames(x_btc, dilation);
    let taps = (0..3).map(|tap| padded.clone().narrow(1, tap * dilation, t)).collect();
    Tensor::cat(taps, 2)
}

/// `[b, t/2, 4c]`: the frames 2i − 1 to 2i + 2, as two neighbouring pairs of frames.
fn fours(x_btc: Tensor<3>) -> Tensor<3> {
    let [b, t, c] = x_btc.dims();
    let pairs = pad_frames(x_btc, 1).reshape([b, t / 2 + 1, 2 * c]);
    let second = pairs.clone().narrow(1, 1, t / 2);
    Tensor::cat(vec![pairs.narrow(1, 0, t / 2), second], 2)
}

/// `n` frames of zeros at either end.
fn pad_frames(x_btc: Tensor<3>, n: usize) -> Tensor<3> {
    let [b, _, c] = x_btc.dims();
    let zeros = Tensor::zeros([b, n, c], &x_btc.device());
    Tensor::cat(vec![zeros.clone(), x_btc, zeros], 1)
}

// The nearest code of each latent, from a matrix of distances.

/// Entries of the distance matrix in memory at a time.
const DISTANCES_AT_ONCE: usize = 1 << 22;

/// See [`nearest`](super::nearest()).
pub fn nearest(latents_nc: &Tensor<2>, codes_vc: &Tensor<2>) -> Vec<u32> {
    let (n, n_codes) = (latents_nc.dims()[0], codes_vc.dims()[0]);
    let rows = (DISTANCES_AT_ONCE / n_codes).max(1);
    let part = |start: usize| latents_nc.clone().narrow(0, start, rows.min(n - start));
    (0..n).step_by(rows).flat_map(|start| nearest_of_part(part(start), codes_vc)).collect()
}

fn nearest_of_part(latents_nc: Tensor<2>, codes_vc: &Tensor<2>) -> Vec<u32> {
    let codes_cv = codes_vc.clone().transpose();
    let norms_1v = (codes_cv.clone() * codes_cv.clone()).sum_dim(0);
    let distances_nv = norms_1v - latents_nc.matmul(codes_cv) * 2.0;
    let ids = distances_nv.argmin(1).into_data();
    ids.iter::<i64>().map(|id| id as u32).collect()
}
