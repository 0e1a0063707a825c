//! The architecture of patches: whole frames into latents, each begun as the principal components of
//! its own frames and mended by residual convolutions; and back.
//!
//! Shapes: b clips, t frames, f features, s frames of a patch, p = s·f values of a patch, k channels of a
//! latent, n = b·t/s patches.

use burn::module::{Module, Param};
use burn::tensor::activation::gelu;
use burn::tensor::module::layer_norm;
use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::halves::{Decode, Encode, Pass, host};
use crate::learn::layers::{Affine, Conv1d};
use crate::learn::params;
use crate::motion::{POSITIONS, ROOT_HEIGHT, ROOT_VELOCITY, ROOT_YAW};
use crate::spec::PatchSpec;

/// Dilations of blocks, over and over.
const DILATIONS: [usize; 3] = [1, 2, 4];

fn blocks(n: usize, width: usize, rng: &mut ChaCha8Rng, device: &Device) -> Vec<Block> {
    let dilations = DILATIONS.into_iter().cycle().take(n);
    dilations.map(|dilation| Block::new(width, dilation, rng, device)).collect()
}

/// Principal components of each patch, plus a network.
#[derive(Module, Debug)]
pub struct PatchEncoder {
    components: Affine,
    input: Affine,
    blocks: Vec<Block>,
    output: Affine,
    #[module(skip)]
    frames: usize,
    #[module(skip)]
    n_seen: usize,
}

impl PatchEncoder {
    /// Fresh weights; the network sees the root and the joints' positions.
    pub fn new(
        sizes: &PatchSpec,
        n_features: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let &PatchSpec { width, frames, latent, encoder_blocks, .. } = sizes;
        let n_seen = POSITIONS.end.min(n_features);
        Self {
            components: Affine::new(frames * n_features, latent, rng, device).fixed(),
            input: Affine::new(frames * n_seen, width, rng, device),
            blocks: blocks(encoder_blocks, width, rng, device),
            output: Affine::zero(width, latent, device),
            frames,
            n_seen,
        }
    }
}

impl Encode for PatchEncoder {
    fn forward(&self, x_btf: Tensor<3>, _: &mut Pass) -> Tensor<3> {
        let [b, t, f] = x_btf.dims();
        let n = b * t / self.frames;
        let begun = self.components.forward(x_btf.clone().reshape([n, self.frames * f]));
        let seen = x_btf.narrow(2, 0, self.n_seen).reshape([n, self.frames * self.n_seen]);
        let added = through(&self.input, &self.blocks, &self.output, seen, b);
        let k = begun.dims()[1];
        (begun + added).reshape([b, t / self.frames, k])
    }

    fn begin(&mut self, patches_np: &Tensor<2>) {
        let f = patches_np.dims()[1] / self.frames;
        let k = self.components.channels_out();
        let (weight, bias) = components(patches_np, f, k);
        self.components.set(weight, bias);
    }
}

/// A linear map from each latent to its patch, plus a network.
#[derive(Module, Debug)]
pub struct PatchDecoder {
    line: Affine,
    input: Affine,
    blocks: Vec<Block>,
    output: Affine,
    #[module(skip)]
    frames: usize,
}

impl PatchDecoder {
    /// Fresh weights.
    pub fn new(
        sizes: &PatchSpec,
        n_features: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let &PatchSpec { width, frames, latent, decoder_blocks, .. } = sizes;
        Self {
            line: Affine::new(latent, frames * n_features, rng, device),
            input: Affine::new(latent, width, rng, device),
            blocks: blocks(decoder_blocks, width, rng, device),
            output: Affine::zero(width, frames * n_features, device),
            frames,
        }
    }
}

impl Decode for PatchDecoder {
    fn forward(&self, latents_btc: Tensor<3>, _: usize, _: &mut Pass) -> Tensor<3> {
        let [b, t, k] = latents_btc.dims();
        let latents_nk = latents_btc.reshape([b * t, k]);
        let begun = self.line.forward(latents_nk.clone());
        let added = through(&self.input, &self.blocks, &self.output, latents_nk, b);
        let p = begun.dims()[1];
        (begun + added).reshape([b, t * self.frames, p / self.frames])
    }

    fn begin(&mut self, latents_nk: &Tensor<2>, patches_np: &Tensor<2>) {
        let (weight, bias) = line(latents_nk, patches_np);
        self.line.set(weight, bias);
    }
}

/// Rows of `b` clips through a layer, blocks and a layer.
fn through(
    input: &Affine,
    blocks: &[Block],
    output: &Affine,
    x_nc: Tensor<2>,
    b: usize,
) -> Tensor<2> {
    let n = x_nc.dims()[0];
    let hidden_nw = input.forward(x_nc);
    let w = hidden_nw.dims()[1];
    let hidden_btw = hidden_nw.reshape([b, n / b, w]);
    let hidden_btw = blocks.iter().fold(hidden_btw, |x, block| block.forward(x));
    output.forward(hidden_btw.reshape([n, w]))
}

// A residual block at the rate of latents.

/// LayerNorm's ε.
const EPSILON: f64 = 1e-5;
/// Share of its usual size at which the second convolution begins, so that blocks begin small.
const SMALL: f32 = 0.3;

/// x + conv₁(gelu(conv₃(norm(x)))), with the dilation in the first convolution.
#[derive(Module, Debug)]
struct Block {
    /// `[c]`.
    gain: Param<Tensor<1>>,
    /// `[c]`.
    bias: Param<Tensor<1>>,
    dilated: Conv1d,
    point: Conv1d,
}

impl Block {
    /// A block that reads latents up to `dilation` away.
    fn new(width: usize, dilation: usize, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        Self {
            gain: params::constant([width], 1.0, device),
            bias: params::constant([width], 0.0, device),
            dilated: Conv1d::same([width; 2], dilation, rng, device),
            point: Conv1d::point([width; 2], rng, device).scaled(SMALL),
        }
    }

    /// `[b, t, c]` to the same.
    fn forward(&self, x_btc: Tensor<3>) -> Tensor<3> {
        let normed = layer_norm(x_btc.clone(), self.gain.val(), Some(self.bias.val()), EPSILON);
        x_btc + self.point.forward(gelu(self.dilated.forward(normed)))
    }
}

// Principal components of weighted patches, and the line back from them.

/// The weight of a feature, close to MPJPE.
const YAW_WEIGHT: f32 = 8.0;
const ROOT_WEIGHT: f32 = 2.0;
const POSITION_WEIGHT: f32 = 1.0;
const OTHER_WEIGHT: f32 = 0.005;

/// Ridge of the line back, as a share of a component's mean square.
const RIDGE: f64 = 1e-3;

/// Rows that are computed with at a time.
const PART: usize = 2048;

/// The first `k` weighted principal components of patches, the largest first: the weight, `[p, k]`, and the
/// bias of z = x·weight + bias of a patch x, with unit mean square over patches and components.
fn components(patches_np: &Tensor<2>, n_features: usize, k: usize) -> (Vec<f32>, Vec<f32>) {
    let [n, p] = patches_np.dims();
    let device = patches_np.device();
    let roots: Vec<f32> = (0..p).map(|i| feature_weight(i % n_features).sqrt()).collect();
    let roots_1p = Tensor::<2>::from_data(TensorData::new(roots.clone(), [1, p]), &device);
    let mean_1p = patches_np.clone().mean_dim(0) * roots_1p.clone();
    let of_part = |part_np: Tensor<2>| {
        let apart_np = part_np * roots_1p.clone() - mean_1p.clone();
        apart_np.clone().transpose().matmul(apart_np)
    };
    let covariance_pp = sum(parts(patches_np).map(of_part)) / n as f64;
    let axes_pk = leading(&covariance_pp, k, &device);
    let spread = (covariance_pp.matmul(axes_pk.clone()) * axes_pk.clone()).sum();
    let size = (f64::from(spread.into_scalar::<f32>()) / k as f64).sqrt().max(f64::MIN_POSITIVE);
    let bias = host(-(mean_1p.matmul(axes_pk.clone()) / size));
    let mut weight = host(axes_pk / size);
    for (row, root) in weight.chunks_exact_mut(k).zip(&roots) {
        row.iter_mut().for_each(|x| *x *= root);
    }
    (weight, bias)
}

/// The least-squares reconstruction of patches from latents: the weight, `[k, p]`, and the bias of
/// x = z·weight + bias.
fn line(latents_nk: &Tensor<2>, patches_np: &Tensor<2>) -> (Vec<f32>, Vec<f32>) {
    let [n, k] = latents_nk.dims();
    let mean_1p = patches_np.clone().mean_dim(0);
    let bias = host(mean_1p.clone());
    let of_part = |(latents_nk, part_np): (Tensor<2>, Tensor<2>)| {
        latents_nk.transpose().matmul(part_np - mean_1p.clone())
    };
    let products_kp = sum(parts(latents_nk).zip(parts(patches_np)).map(of_part));
    let moments = host(latents_nk.clone().transpose().matmul(latents_nk.clone()));
    let mut moments: Vec<f64> = moments.into_iter().map(f64::from).collect();
    (0..k).for_each(|i| moments[i * k + i] += RIDGE * n as f64);
    (solve(moments, host(products_kp), k), bias)
}

/// Rows at a time, to avoid a second copy of all patches.
fn parts(rows: &Tensor<2>) -> impl Iterator<Item = Tensor<2>> {
    let n = rows.dims()[0];
    let part = move |start| rows.clone().narrow(0, start, PART.min(n - start));
    (0..n).step_by(PART).map(part)
}

fn sum(tensors: impl Iterator<Item = Tensor<2>>) -> Tensor<2> {
    tensors.reduce(|a, b| a + b).expect("at least one patch")
}

fn feature_weight(feature: usize) -> f32 {
    match feature {
        ROOT_YAW => YAW_WEIGHT,
        _ if ROOT_VELOCITY.contains(&feature) || feature == ROOT_HEIGHT => ROOT_WEIGHT,
        _ if POSITIONS.contains(&feature) => POSITION_WEIGHT,
        _ => OTHER_WEIGHT,
    }
}

/// The solution X of A X = B for a positive definite A `[k, k]` and B `[k, p]` (Cholesky).
fn solve(mut a: Vec<f64>, b: Vec<f32>, k: usize) -> Vec<f32> {
    for j in 0..k {
        for i in j..k {
            let sum: f64 = (0..j).map(|m| a[i * k + m] * a[j * k + m]).sum();
            let rest = a[i * k + j] - sum;
            a[i * k + j] = if i == j { rest.sqrt() } else { rest / a[j * k + j] };
        }
    }
    let rows = b.chunks_exact(b.len() / k);
    let mut x: Vec<Vec<f64>> =
        rows.map(|row| row.iter().copied().map(f64::from).collect()).collect();
    for i in 0..k {
        let (done, rest) = x.split_at_mut(i);
        let factors = a[i * k..][..i].to_vec();
        eliminate(&mut rest[0], done, &factors, a[i * k + i]);
    }
    for i in (0..k).rev() {
        let (rest, done) = x.split_at_mut(i + 1);
        let factors: Vec<f64> = (i + 1..k).map(|m| a[m * k + i]).collect();
        eliminate(&mut rest[i], done, &factors, a[i * k + i]);
    }
    x.concat().into_iter().map(|x| x as f32).collect()
}

/// row ← (row − Σ factor · other) / pivot.
fn eliminate(row: &mut [f64], others: &[Vec<f64>], factors: &[f64], pivot: f64) {
    for (other, factor) in others.iter().zip(factors) {
        row.iter_mut().zip(other).for_each(|(x, other)| *x -= factor * other);
    }
    row.iter_mut().for_each(|x| *x /= pivot);
}

// The leading eigenvectors of a symmetric matrix.

/// Rounds of orthogonal iteration; the first axes are exact long before.
const ROUNDS: usize = 60;

/// Orthonormal eigenvectors of the `k` largest eigenvalues, by orthogonal iteration, `[p, k]`.
pub fn leading(symmetric_pp: &Tensor<2>, k: usize, device: &Device) -> Tensor<2> {
    let p = symmetric_pp.dims()[0];
    let start = params::normal([p, k], 1.0, &mut ChaCha8Rng::seed_from_u64(0), &Device::flex());
    let mut axes = orthonormal(host(start.val()), k);
    for _ in 0..ROUNDS {
        let axes_pk = Tensor::<2>::from_data(TensorData::new(axes, [p, k]), device);
        axes = orthonormal(host(symmetric_pp.clone().matmul(axes_pk)), k);
    }
    Tensor::from_data(TensorData::new(axes, [p, k]), device)
}

/// Columns made orthonormal, the first first (Gram and Schmidt, twice against rounding); each with its
/// largest entry above zero.
fn orthonormal(columns: Vec<f32>, k: usize) -> Vec<f32> {
    let p = columns.len() / k;
    let column = |j: usize| (0..p).map(|i| f64::from(columns[i * k + j])).collect();
    let mut found: Vec<Vec<f64>> = Vec::with_capacity(k);
    for j in 0..k {
        let mut axis: Vec<f64> = column(j);
        for _ in 0..2 {
            for other in &found {
                let along: f64 = axis.iter().zip(other).map(|(a, b)| a * b).sum();
                axis.iter_mut().zip(other).for_each(|(a, b)| *a -= along * b);
            }
        }
        let largest =
            axis.iter().copied().fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
        let norm = axis.iter().map(|a| a * a).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
        axis.iter_mut().for_each(|a| *a *= largest.signum() / norm);
        found.push(axis);
    }
    (0..p).flat_map(|i| found.iter().map(move |axis| axis[i] as f32)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tensor(values: Vec<f32>, shape: [usize; 2]) -> Tensor<2> {
        Tensor::from_data(TensorData::new(values, shape), &Device::flex())
    }

    #[test]
    fn the_solution_solves() {
        let a = vec![4.0, 1.0, 0.5, 1.0, 3.0, -1.0, 0.5, -1.0, 5.0];
        let x = solve(a.clone(), vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 3);
        for (i, column) in (0..3).flat_map(|i| [(i, 0), (i, 1)]) {
            let b: f64 = (0..3).map(|m| a[i * 3 + m] * f64::from(x[m * 2 + column])).sum();
            assert!((b - (2 * i + column + 1) as f64).abs() < 1e-5, "{b}");
        }
    }

    #[test]
    fn patches_of_two_directions_come_back_from_two_components() {
        // Position columns alone, so that every value counts as much.
        let (n, p) = (200, 8);
        let value = |i: usize, j: usize| {
            let (a, b) = ((i as f32 * 0.7).sin(), (i as f32 * 1.9).cos() * 0.3);
            a * (j as f32 + 1.0) + b * ((j * j) as f32 - 20.0) + 2.0
        };
        let rows = (0..n).flat_map(|i| (0..p).map(move |j| value(i, j))).collect();
        let patches = tensor(rows, [n, p]);
        let (weight, bias) = components(&patches, p, 2);
        let latents = patches.clone().matmul(tensor(weight, [p, 2])) + tensor(bias, [1, 2]);
        let size = latents.clone().powf_scalar(2.0).mean().into_scalar::<f32>();
        assert!((size - 1.0).abs() < 1e-2, "{size}");
        let (weight, bias) = line(&latents, &patches);
        let back = latents.matmul(tensor(weight, [2, p])) + tensor(bias, [1, p]);
        let off = (back - patches.clone()).powf_scalar(2.0).mean().into_scalar::<f32>();
        let all = patches.powf_scalar(2.0).mean().into_scalar::<f32>();
        assert!(off < 1e-3 * all, "{off} of {all}");
    }
}
