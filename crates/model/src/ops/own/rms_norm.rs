//! RMSNorm over rows.

use super::lanes::{LANES, Lanes, vectorised};
use super::maths::dot;

vectorised! {
    /// Normalises the rows of `x` `[n, d]` into `output` `[n, d]`, and notes 1 / rms of each `[n]`.
    pub fn forward(
        x: &[f32],
        gamma: &[f32],
        epsilon: f32,
        output: &mut [f32],
        inverses: &mut [f32],
    ) {
        let d = gamma.len();
        let rows = x.chunks_exact(d).zip(output.chunks_exact_mut(d));
        for ((x, output), inverse) in rows.zip(inverses) {
            *inverse = 1.0 / (dot::<L>(x, x) / d as f32 + epsilon).sqrt();
            scale::<L>(x, gamma, *inverse, output);
        }
    }
}

vectorised! {
    /// What [`forward`] wrote, once more, from the noted 1 / rms.
    pub fn again(x: &[f32], gamma: &[f32], inverses: &[f32], output: &mut [f32]) {
        let d = gamma.len();
        let rows = x.chunks_exact(d).zip(output.chunks_exact_mut(d));
        for ((x, output), inverse) in rows.zip(inverses) {
            scale::<L>(x, gamma, *inverse, output);
        }
    }
}

vectorised! {
    /// Adds the gradient by `x` to `to` `[n, d]` and that by gamma to `grad_gamma` `[d]`, given the
    /// gradient by the output, which is spoilt.
    pub fn backward(
        gradient: &mut [f32],
        x: &[f32],
        gamma: &[f32],
        inverses: &[f32],
        grad_gamma: &mut [f32],
        to: &mut [f32],
    ) {
        let d = gamma.len();
        let rows = gradient.chunks_exact_mut(d).zip(x.chunks_exact(d)).zip(to.chunks_exact_mut(d));
        for (((gradient, x), to), &inverse) in rows.zip(inverses) {
            let product = through_gamma::<L>(gradient, x, gamma, grad_gamma, inverse);
            through_rms::<L>(gradient, x, inverse, product / d as f32, to);
        }
    }
}

/// x inverse gamma.
#[inline(always)]
fn scale<L: Lanes>(x: &[f32], gamma: &[f32], inverse: f32, output: &mut [f32]) {
    let operands = x.chunks(LANES).zip(gamma.chunks(LANES));
    for (output, (x, gamma)) in output.chunks_mut(LANES).zip(operands) {
        L::read(x).mul(L::splat(inverse)).mul(L::read(gamma)).write(output);
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
    let mut product = L::splat(0.0);
    for ((gradient, x), (gamma, grad_gamma)) in row.zip(parameters) {
        let (g, x) = (L::read(gradient), L::read(x));
        g.mul_add(x.mul(L::splat(inverse)), L::read(grad_gamma)).write(grad_gamma);
        let g = g.mul(L::read(gamma));
        g.write(gradient);
        product = g.mul_add(x, product);
    }
    product.sum()
}

/// Adds inverse (g − x inverse² mean), where `mean` is that of g x.
#[inline(always)]
fn through_rms<L: Lanes>(gradient: &[f32], x: &[f32], inverse: f32, mean: f32, to: &mut [f32]) {
    let slope = L::splat(-mean * inverse * inverse);
    let operands = gradient.chunks(LANES).zip(x.chunks(LANES));
    for (to, (gradient, x)) in to.chunks_mut(LANES).zip(operands) {
        let by_x = L::read(x).mul_add(slope, L::read(gradient));
        by_x.mul_add(L::splat(inverse), L::read(to)).write(to);
    }
}
