//! The nearest code of each latent, from a matrix of distances.

use burn::tensor::Tensor;

/// Entries of the distance matrix that are held at a time.
const DISTANCES_AT_ONCE: usize = 1 << 22;

/// See [`nearest`](crate::ops::nearest()).
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
