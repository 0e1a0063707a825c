//! Principal components of weighted patches, and the line back from them.
//!
//! Shapes: n patches, p values of a patch, k components.

use burn::tensor::{Tensor, TensorData};

use crate::motion::{POSITIONS, ROOT_HEIGHT, ROOT_VELOCITY, ROOT_YAW};
use crate::tokenizer::axes::{host, leading};

/// How much a feature counts for: near what MPJPE counts.
const YAW_WEIGHT: f32 = 8.0;
const ROOT_WEIGHT: f32 = 2.0;
const POSITION_WEIGHT: f32 = 1.0;
const OTHER_WEIGHT: f32 = 0.005;

/// Ridge of the line back, as a share of a component's mean square.
const RIDGE: f64 = 1e-3;

/// Rows that are computed with at a time.
const PART: usize = 2048;

/// z = x·weight + bias of a patch x, with unit mean square over patches and components.
pub struct Components {
    /// `[p, k]`, row-major.
    pub weight: Vec<f32>,
    /// `[k]`.
    pub bias: Vec<f32>,
}

/// x = z·weight + bias, the least squares.
pub struct Line {
    /// `[k, p]`, row-major.
    pub weight: Vec<f32>,
    /// `[p]`.
    pub bias: Vec<f32>,
}

/// The first `k` weighted principal components of patches, the largest first.
pub fn components(patches_np: &Tensor<2>, n_features: usize, k: usize) -> Components {
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
    Components { weight, bias }
}

/// What gives patches back from their latents with the least squared error.
pub fn line(latents_nk: &Tensor<2>, patches_np: &Tensor<2>) -> Line {
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
    let weight = solve(moments, host(products_kp), k);
    Line { weight, bias }
}

/// Rows at a time, so that no second copy of all patches is held.
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

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

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
        let Components { weight, bias } = components(&patches, p, 2);
        let latents = patches.clone().matmul(tensor(weight, [p, 2])) + tensor(bias, [1, 2]);
        let size = latents.clone().powf_scalar(2.0).mean().into_scalar::<f32>();
        assert!((size - 1.0).abs() < 1e-2, "{size}");
        let Line { weight, bias } = line(&latents, &patches);
        let back = latents.matmul(tensor(weight, [2, p])) + tensor(bias, [1, p]);
        let off = (back - patches.clone()).powf_scalar(2.0).mean().into_scalar::<f32>();
        let all = patches.powf_scalar(2.0).mean().into_scalar::<f32>();
        assert!(off < 1e-3 * all, "{off} of {all}");
    }
}
