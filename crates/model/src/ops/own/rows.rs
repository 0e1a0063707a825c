//! Kernels on rows: eˣ, sums and maxima, RMSNorm, and picking rows of a matrix.
//!
//! Every sum runs over sixteen partial sums that are then added as a tree, on every machine.

use std::sync::Arc;

use burn_flex::FlexTensor;

use super::buffers::{Buffer, dims, elements, elements_mut};
use super::lanes::{LANES, Lanes};
use super::vectors::vectorised;
use super::{Above, Gradients, Operation};

/// eˣ within 2 units in the last place, without branches; arguments are clamped to [-87.3, 88].
///
/// x = n ln 2 + f with |f| <= ln 2 / 2, then eˣ = 2ⁿ eᶠ with a polynomial of degree 6 for eᶠ.
/// Below the range the result is 1e-38 and not zero. NaN stays NaN.
#[inline(always)]
pub fn exp<L: Lanes>(x: L) -> L {
    exp_below_88(L::splat(88.0).min(x))
}

/// As [`exp`], of arguments that are no larger than 88: what remains when the largest has been subtracted.
#[inline(always)]
pub fn exp_below_88<L: Lanes>(x: L) -> L {
    // Adding 1.5 x 2^23 rounds to an integer and leaves it in the low bits.
    const ROUND: f32 = 12_582_912.0;
    // ln 2 in two parts, the first with so few bits that its products with n are exact.
    const LN_2_HIGH: f32 = 0.693_145_75;
    const LN_2_LOW: f32 = 1.428_606_8e-6;
    let x = L::splat(-87.3).max(x);
    let shifted = x.mul_add(L::splat(std::f32::consts::LOG2_E), L::splat(ROUND));
    let n = shifted.sub(L::splat(ROUND));
    let f = n.mul_add(L::splat(-LN_2_LOW), n.mul_add(L::splat(-LN_2_HIGH), x));
    let mut series = L::splat(0.001_388_888_9);
    for coefficient in [0.008_333_361, 0.041_666_638, 0.166_666_67, 0.5, 1.0, 1.0] {
        series = series.mul_add(f, L::splat(coefficient));
    }
    series.mul(shifted.power_of_two())
}

/// 1 / (1 + e⁻ˣ).
#[inline(always)]
pub fn sigmoid<L: Lanes>(x: L) -> L {
    let one = L::splat(1.0);
    one.div(one.add(exp(L::splat(0.0).sub(x))))
}

/// Σ aᵢ bᵢ.
#[inline(always)]
pub fn dot<L: Lanes>(a: &[f32], b: &[f32]) -> f32 {
    let mut sum = L::splat(0.0);
    for (a, b) in a.chunks(LANES).zip(b.chunks(LANES)) {
        sum = L::read(a).mul_add(L::read(b), sum);
    }
    sum.sum()
}

/// The largest element; NaN may be ignored, and an empty slice gives `f32::MIN`.
#[inline(always)]
pub fn max<L: Lanes>(x: &[f32]) -> f32 {
    let least = L::splat(f32::MIN);
    let (whole, rest) = x.as_chunks();
    let mut largest = L::read(rest).first(rest.len(), least);
    for x in whole {
        largest = L::load(x).max(largest);
    }
    largest.largest()
}

/// Σ e^(x − shift), where no x is larger than the shift by 88.
#[inline(always)]
pub fn sum_of_exp<L: Lanes>(x: &[f32], shift: f32) -> f32 {
    let shift = L::splat(shift);
    let (whole, rest) = x.as_chunks();
    let mut sum = exp_below_88(L::read(rest).sub(shift)).first(rest.len(), L::splat(0.0));
    for x in whole {
        sum = sum.add(exp_below_88(L::load(x).sub(shift)));
    }
    sum.sum()
}

vectorised! {
    /// Adds rows to a row, one after another.
    pub fn add_rows(to: &mut [f32], rows: &[f32]) {
        for row in rows.chunks_exact(to.len()) {
            for (to, from) in to.chunks_mut(LANES).zip(row.chunks(LANES)) {
                L::read(to).add(L::read(from)).write(to);
            }
        }
    }
}

// RMSNorm.

vectorised! {
    /// Normalises the rows of `x` `[n, d]` into `output` `[n, d]`, and notes 1 / rms of each `[n]`.
    pub fn rms_norm(
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
    /// Recomputes the output of [`rms_norm`] from the kept 1 / rms.
    pub fn rms_norm_again(x: &[f32], gamma: &[f32], inverses: &[f32], output: &mut [f32]) {
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
    pub fn rms_norm_back(
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

/// RMSNorm alone, of x and γ; keeps its inputs and 1 / rms of each row. See
/// [`Kernels::rms_norm`](crate::ops::Kernels::rms_norm).
#[derive(Clone, Copy, Debug)]
pub struct RmsNorm {
    pub epsilon: f32,
}

impl Operation<2> for RmsNorm {
    type Kept = ([FlexTensor; 2], Buffer);

    fn forward(&self, inputs: &[FlexTensor; 2], keep: bool) -> (FlexTensor, Option<Self::Kept>) {
        let [x, gamma] = inputs.each_ref().map(elements);
        let (mut output, mut inverses) = (Buffer::new(x.len()), Buffer::new(x.len() / gamma.len()));
        rms_norm(x, gamma, self.epsilon, &mut output, &mut inverses);
        (output.into_tensor(dims(&inputs[0])), keep.then(|| (inputs.clone(), inverses)))
    }

    fn backward(
        &self,
        (inputs, inverses): Self::Kept,
        (mut gradient, _): Above<2>,
    ) -> Gradients<2> {
        let ([x, gamma], [n, d]) = (inputs.each_ref().map(elements), dims(&inputs[0]));
        let (mut by_x, mut by_gamma) = (Buffer::zeros(n * d), Buffer::zeros(d));
        let change = elements_mut(&mut gradient);
        rms_norm_back(change, x, gamma, &inverses, &mut by_gamma, &mut by_x);
        [by_x.into_tensor([n, d]), by_gamma.into_tensor([d])].map(Some)
    }
}

// Picking rows, for embeddings and for the rows that a loss is taken on.

/// Picking rows, in their order; keeps the shape. See
/// [`Kernels::select_rows`](crate::ops::Kernels::select_rows).
#[derive(Clone, Debug)]
pub struct SelectRows(pub Arc<[u32]>);

impl Operation<1> for SelectRows {
    type Kept = [usize; 2];

    fn forward(&self, [x]: &[FlexTensor; 1], _: bool) -> (FlexTensor, Option<Self::Kept>) {
        let ([m, d], x) = (dims(x), elements(x));
        let mut output = Buffer::new(self.0.len() * d);
        for (&row, to) in self.0.iter().zip(output.chunks_exact_mut(d)) {
            to.copy_from_slice(&x[row as usize * d..][..d]);
        }
        (output.into_tensor([self.0.len(), d]), Some([m, d]))
    }

    /// Each row of the gradient by the output is added to the row it came from, in the order of the
    /// output.
    fn backward(&self, [m, d]: Self::Kept, (gradient, _): Above<1>) -> Gradients<1> {
        let mut by_x = Buffer::zeros(m * d);
        for (&row, from) in self.0.iter().zip(elements(&gradient).chunks_exact(d)) {
            add_rows(&mut by_x[row as usize * d..][..d], from);
        }
        [Some(by_x.into_tensor([m, d]))]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[inline(always)]
    fn exp_of_each_lane<L: Lanes>(x: &mut [f32]) {
        for x in x.chunks_mut(LANES) {
            exp(L::read(x)).write(x);
        }
    }
    vectorised! {
        fn exp_of_each(x: &mut [f32]) { exp_of_each_lane::<L>(x) }
    }
    vectorised! {
        fn dot_of(a: &[f32], b: &[f32]) -> f32 { dot::<L>(a, b) }
    }
    vectorised! {
        fn max_of(x: &[f32]) -> f32 { max::<L>(x) }
    }
    vectorised! {
        fn sum_of_exp_of(x: &[f32], shift: f32) -> f32 { sum_of_exp::<L>(x, shift) }
    }

    #[test]
    fn exp_is_within_two_units_in_the_last_place() {
        let x: Vec<f32> = (-870_000..880_000).map(|i| i as f32 * 1e-4).collect();
        let mut y = x.clone();
        exp_of_each(&mut y);
        for (x, y) in x.into_iter().zip(y) {
            let right = f64::from(x).exp();
            let error = (f64::from(y) - right).abs() / right;
            assert!(error < 2.0 * f64::from(f32::EPSILON), "exp({x}) is off by {error:e}");
        }
    }

    #[test]
    fn exp_keeps_nan_and_saturates_outside_its_range() {
        let mut x = [f32::NAN, f32::NEG_INFINITY, 1e9];
        exp_of_each(&mut x);
        assert!(x[0].is_nan() && x[1] < 1.3e-38 && x[2] > 1e38 && x[2].is_finite(), "{x:?}");
    }

    #[test]
    fn portable_lanes_give_the_same_exponentials() {
        let x: Vec<f32> = (-800..800).map(|i| i as f32 * 0.1).collect();
        let (mut native, mut portable) = (x.clone(), x);
        exp_of_each(&mut native);
        exp_of_each_lane::<[f32; LANES]>(&mut portable);
        let off = |(a, b): (&f32, &f32)| ((a - b) / b).abs() > 2.0 * f32::EPSILON;
        assert_eq!(native.iter().zip(&portable).filter(|&pair| off(pair)).count(), 0);
    }

    #[test]
    fn reductions_agree_with_double_precision_at_every_length() {
        for n in 1..70 {
            let a: Vec<f32> = (0..n).map(|i| ((i * 37 % 19) as f32) * 0.25 - 2.0).collect();
            let b: Vec<f32> = a.iter().map(|x| x * 0.5 + 1.0).collect();
            let product: f64 = a.iter().zip(&b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum();
            let sum: f64 = a.iter().map(|&x| f64::from(x - 2.0).exp()).sum();
            assert!((f64::from(dot_of(&a, &b)) - product).abs() < 1e-4, "{n}");
            assert!((f64::from(sum_of_exp_of(&a, 2.0)) / sum - 1.0).abs() < 1e-6, "{n}");
            assert_eq!(max_of(&a), a.iter().copied().fold(f32::MIN, f32::max), "{n}");
        }
    }
}
