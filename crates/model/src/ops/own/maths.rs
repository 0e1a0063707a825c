//! The arithmetic that the own operations share: eˣ, sums and maxima over rows.
//!
//! Every sum runs over sixteen partial sums that are then added as a tree, on every machine.

use super::lanes::{LANES, Lanes};

/// eˣ within 2 units in the last place, without branches; arguments are held to [-87.3, 88].
///
/// x = n ln 2 + f with |f| <= ln 2 / 2, then eˣ = 2ⁿ eᶠ with a polynomial of degree 6 for eᶠ.
/// Below the range the result is 1e-38 and not zero. NaN stays NaN.
#[inline(always)]
pub fn exp<L: Lanes>(x: L) -> L {
    // Adding 1.5 x 2^23 rounds to an integer and leaves it in the low bits.
    const ROUND: f32 = 12_582_912.0;
    // ln 2 in two parts, the first with so few bits that its products with n are exact.
    const LN_2_HIGH: f32 = 0.693_145_75;
    const LN_2_LOW: f32 = 1.428_606_8e-6;
    let x = L::splat(88.0).min(L::splat(-87.3).max(x));
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

/// The largest element; NaN may be passed over, and `f32::MIN` stands for an empty slice.
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

/// Σ e^(x − shift).
#[inline(always)]
pub fn sum_of_exp<L: Lanes>(x: &[f32], shift: f32) -> f32 {
    let shift = L::splat(shift);
    let (whole, rest) = x.as_chunks();
    let mut sum = exp(L::read(rest).sub(shift)).first(rest.len(), L::splat(0.0));
    for x in whole {
        sum = sum.add(exp(L::load(x).sub(shift)));
    }
    sum.sum()
}

#[cfg(test)]
mod tests {
    use super::super::lanes::vectorised;
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
