//! The leading eigenvectors of a symmetric matrix.

use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::learn::params;

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

/// The values of a tensor, row-major.
pub fn host<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().try_into_vec().expect("values are f32")
}
