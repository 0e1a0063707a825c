//! RMSNorm over rows.

use super::lanes::{LANES, Lanes, vectorised};
use super::maths::dot;

vectorised! {
    /// Normalises the rows of `x` `[n, d]`: the output `[n, d]`, and 1 / rms of each row `[n]`.
    pub fn forward(x: &[f32], gamma: &[f32], epsilon: f32) -> (Vec<f32>, Vec<f32>) {
        let d = gamma.len();
        let mut output = vec![0.0; x.len()];
        let mut inverses = Vec::with_capacity(x.len() / d);
        for (x, output) in x.chunks_exact(d).zip(output.chunks_exact_mut(d)) {
            let inverse = 1.0 / (dot::<L>(x, x) / d as f32 + epsilon).sqrt();
            inverses.push(inverse);
            let operands = x.chunks(LANES).zip(gamma.chunks(LANES));
            for (output, (x, gamma)) in output.chunks_mut(LANES).zip(operands) {
                L::read(x).mul(L::splat(inverse)).mul(L::read(gamma)).write(output);
            }
        }
        (output, inverses)
    }
}

vectorised! {
    /// Turns the gradient by the output into the gradient by `x`, and returns that by gamma.
    pub fn backward(gradient: &mut [f32], x: &[f32], gamma: &[f32], inverses: &[f32]) -> Vec<f32> {
        let d = gamma.len();
        let mut grad_gamma = vec![0.0; d];
        let rows = gradient.chunks_exact_mut(d).zip(x.chunks_exact(d)).zip(inverses);
        for ((gradient, x), &inverse) in rows {
            let product = through_gamma::<L>(gradient, x, gamma, &mut grad_gamma, inverse);
            through_rms::<L>(gradient, x, inverse, product / d as f32);
        }
        grad_gamma
    }
}

/// Adds a row's share to the gradient by gamma, multiplies the row of gradients by gamma, and
/// returns its product with `x`.
#[inline(always)]
fn through_gamma<L: Lanes>(
    gradient: &mut [f32],
    x: &[f32],
    gamma: &[f32],
    grad_gamma: &mut [f32],
    inverse: f32,
) -> f32 {
    let parameters = gamma.chunks(LANES).zip(grad_gamma.chunks_mut(LANES));
    let row = gradient.chunks_mut(LANES).zip(x.chunks(LANES));
    for ((gradient, x), (gamma, grad_gamma)) in row.zip(parameters) {
        let normalised = L::read(x).mul(L::splat(inverse));
        L::read(gradient).mul_add(normalised, L::read(grad_gamma)).write(grad_gamma);
        L::read(gradient).mul(L::read(gamma)).write(gradient);
    }
    dot::<L>(gradient, x)
}

/// inverse (g − x inverse² mean), where `mean` is that of g x.
#[inline(always)]
fn through_rms<L: Lanes>(gradient: &mut [f32], x: &[f32], inverse: f32, mean: f32) {
    let slope = L::splat(-mean * inverse * inverse);
    for (gradient, x) in gradient.chunks_mut(LANES).zip(x.chunks(LANES)) {
        L::read(x).mul_add(slope, L::read(gradient)).mul(L::splat(inverse)).write(gradient);
    }
}
