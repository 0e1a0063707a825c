//! e^x and ln x for a handful of rows at a time.
//!
//! Branch-free, so that the compiler turns a loop over [`LANES`] rows into vector instructions; within an ulp or two of
//! the standard library's. Nothing depends on how wide the vectors are: with `FUSED`, where a multiply-add rounds once,
//! every processor that has the instruction computes the same bits.

/// Rows that are computed side by side.
pub(super) const LANES: usize = 8;

/// One number a row.
pub(super) type Lane = [f64; LANES];

/// 1.5 · 2^52: adding it rounds to an integer in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0;
const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// e^x; x beyond ±700 is taken as ±700.
#[inline(always)]
pub(super) fn exp<const FUSED: bool>(x: f64) -> f64 {
    let x = x.clamp(-700.0, 700.0);
    let shifted = fused::<FUSED>(x, std::f64::consts::LOG2_E, ROUND);
    let n = shifted - ROUND;
    let r = fused::<FUSED>(-n, LN2_LOW, fused::<FUSED>(-n, LN2_HIGH, x));
    // e^r by its series to r^13, |r| < 0.35.
    let mut p = 1.0 / 6_227_020_800.0;
    p = fused::<FUSED>(p, r, 1.0 / 479_001_600.0);
    p = fused::<FUSED>(p, r, 1.0 / 39_916_800.0);
    p = fused::<FUSED>(p, r, 1.0 / 3_628_800.0);
    p = fused::<FUSED>(p, r, 1.0 / 362_880.0);
    p = fused::<FUSED>(p, r, 1.0 / 40_320.0);
    p = fused::<FUSED>(p, r, 1.0 / 5_040.0);
    p = fused::<FUSED>(p, r, 1.0 / 720.0);
    p = fused::<FUSED>(p, r, 1.0 / 120.0);
    p = fused::<FUSED>(p, r, 1.0 / 24.0);
    p = fused::<FUSED>(p, r, 1.0 / 6.0);
    p = fused::<FUSED>(p, r, 0.5);
    p = fused::<FUSED>(p, r, 1.0);
    p = fused::<FUSED>(p, r, 1.0);
    let exponent = shifted.to_bits().wrapping_add(1023) << 52;
    p * f64::from_bits(exponent)
}

/// ln x of a positive normal number.
#[inline(always)]
pub(super) fn ln<const FUSED: bool>(x: f64) -> f64 {
    // x = m 2^e with m between √½ and √2.
    const SQRT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
    let bits = x.to_bits().wrapping_sub(SQRT_HALF);
    let e_bits = ((bits as i64) >> 52) as u64;
    let m = f64::from_bits(x.to_bits().wrapping_sub(e_bits << 52));
    let e = f64::from_bits(ROUND.to_bits().wrapping_add(e_bits)) - ROUND;
    // ln m = 2 artanh s.
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let mut p = 1.0 / 21.0;
    p = fused::<FUSED>(p, z, 1.0 / 19.0);
    p = fused::<FUSED>(p, z, 1.0 / 17.0);
    p = fused::<FUSED>(p, z, 1.0 / 15.0);
    p = fused::<FUSED>(p, z, 1.0 / 13.0);
    p = fused::<FUSED>(p, z, 1.0 / 11.0);
    p = fused::<FUSED>(p, z, 1.0 / 9.0);
    p = fused::<FUSED>(p, z, 1.0 / 7.0);
    p = fused::<FUSED>(p, z, 1.0 / 5.0);
    p = fused::<FUSED>(p, z, 1.0 / 3.0);
    e * LN2_HIGH + (2.0 * s + (2.0 * s * z * p + e * LN2_LOW))
}

#[inline(always)]
pub(super) fn product(a: &Lane, b: &Lane) -> Lane {
    let mut product = *a;
    for (a, b) in product.iter_mut().zip(b) {
        *a *= b;
    }
    product
}

/// a b + c.
#[inline(always)]
pub(super) fn fused<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn both_agree_with_the_standard_library(x in -650.0..650.0f64) {
            let y = x.exp();
            for (exp, ln) in [(exp::<true>(x), ln::<true>(y)), (exp::<false>(x), ln::<false>(y))] {
                prop_assert!((exp / y - 1.0).abs() < 5e-16);
                prop_assert!((ln - y.ln()).abs() <= 4e-16 * y.ln().abs().max(0.3));
            }
        }
    }

    #[test]
    fn whole_powers_are_exact_and_extremes_finite() {
        assert_eq!(exp::<true>(0.0), 1.0);
        assert_eq!(ln::<true>(1.0), 0.0);
        assert!(exp::<true>(1e9).is_finite() && exp::<true>(-1e9) > 0.0);
    }
}
