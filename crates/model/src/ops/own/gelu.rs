//! GELU, x Φ(x), from Φ of the negative magnitude.

use super::lanes::{LANES, Lanes, vectorised};
use super::maths::exp;

vectorised! {
    /// x Φ(x) of each element, into `output`.
    pub fn forward(x: &[f32], output: &mut [f32]) {
        for (output, x) in output.chunks_mut(LANES).zip(x.chunks(LANES)) {
            let x = L::read(x);
            let [tail, _] = tail_and_density(x);
            gelu(x, tail).write(output);
        }
    }
}

vectorised! {
    /// The gradient by `x`, into `change`; turns that by the output into the output.
    pub fn backward(x: &[f32], change: &mut [f32], output: &mut [f32]) {
        let to = change.chunks_mut(LANES).zip(output.chunks_mut(LANES));
        for (x, (change, output)) in x.chunks(LANES).zip(to) {
            let (value, gradient) = (L::read(x), L::read(output));
            let [tail, density] = tail_and_density(value);
            let (zero, one) = (L::splat(0.0), L::splat(1.0));
            let positive = one.min(zero.max(value.mul(L::splat(1e38))));
            let phi = positive.mul_add(one.sub(tail).sub(tail), tail);
            gradient.mul(value.mul_add(density, phi)).write(change);
            gelu(value, tail).write(output);
        }
    }
}

/// max(x, 0) − |x| Φ(−|x|).
#[inline(always)]
fn gelu<L: Lanes>(x: L, tail: L) -> L {
    let zero = L::splat(0.0);
    zero.max(x).sub(magnitude(x).mul(tail))
}

#[inline(always)]
fn magnitude<L: Lanes>(x: L) -> L {
    L::splat(0.0).sub(x).max(x)
}

/// Φ(−|x|) within 1e-7 (Abramowitz and Stegun 1964, 7.1.26), and the normal density at x.
#[inline(always)]
fn tail_and_density<L: Lanes>(x: L) -> [L; 2] {
    let one = L::splat(1.0);
    let z = magnitude(x).mul(L::splat(std::f32::consts::FRAC_1_SQRT_2));
    let t = one.div(z.mul_add(L::splat(0.327_591_1), one));
    let mut series = L::splat(1.061_405_4);
    for coefficient in [-1.453_152, 1.421_413_7, -0.284_496_74, 0.254_829_6] {
        series = series.mul_add(t, L::splat(coefficient));
    }
    let power = exp(L::splat(0.0).sub(z.mul(z)));
    let tail = series.mul(t).mul(power).mul(L::splat(0.5));
    [tail, power.mul(L::splat(0.398_942_3))]
}
