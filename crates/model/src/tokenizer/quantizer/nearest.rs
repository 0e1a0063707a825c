//! The code whose direction is nearest to that of each latent.
//!
//! Shapes: n latents, c channels, v codes.

use burn::tensor::Tensor;

use crate::ops::nearest;

/// Length that a row is taken to have at least before it is made 1 long.
const SHORTEST: f64 = 1e-12;

/// argmax over codes of cos(latent, code), the first of equals.
pub fn nearest_direction(latents_nc: &Tensor<2>, codes_vc: &Tensor<2>) -> Vec<u32> {
    nearest(&directions(latents_nc), &directions(codes_vc))
}

/// Rows of length 1; a row of zeros stays one.
fn directions(rows_nc: &Tensor<2>) -> Tensor<2> {
    let norms_n1 = (rows_nc.clone() * rows_nc.clone()).sum_dim(1).sqrt();
    rows_nc.clone() / norms_n1.clamp_min(SHORTEST)
}
