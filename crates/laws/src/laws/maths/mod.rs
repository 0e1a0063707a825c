//! Statistics, lines, least squares and random draws, independent of runs; here systems of linear equations.

pub(in crate::laws) mod engine;
pub(in crate::laws) mod stats;

/// Numbers as text, for a person.
pub mod text {
    /// `x` in scientific notation with at most `digits` after the point, trailing zeros left out.
    pub fn short(x: f64, digits: usize) -> String {
        let text = format!("{x:.digits$e}");
        match text.split_once('e') {
            Some((mantissa, exponent)) if mantissa.contains('.') => {
                let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.');
                format!("{mantissa}e{exponent}")
            }
            _ => text,
        }
    }

    /// A budget or another count in at most four significant digits: `3e10`, `1.215e18`.
    pub fn count(x: f64) -> String {
        short(x, 3)
    }

    /// A factor in two digits, or three below 2: `1.04`, `1.6`, `9.4`, `94`, `310`.
    pub fn times(factor: f64) -> String {
        let digits = if factor < 2.0 { 2 } else { 1 };
        let rounded: f64 = format!("{factor:.digits$e}").parse().expect("a number was written");
        rounded.to_string()
    }

    /// A vocabulary as a law has it: below 10 no whole number, so that it never reads 0.
    pub fn codes(v: f64) -> String {
        if v < 10.0 { times(v) } else { format!("{v:.0}") }
    }
}

/// e^x and ln x for a handful of rows at a time.
///
/// Branch-free, so that the compiler turns a loop over [`lanes::LANES`] rows into vector instructions; within an ulp or two of
/// the standard library's. Nothing depends on how wide the vectors are: with `FUSED`, where a multiply-add rounds once,
/// every processor that has the instruction computes the same bits.
pub(in crate::laws) mod lanes {
    /// Rows that are computed side by side.
    pub const LANES: usize = 8;

    /// One number a row.
    pub type Lane = [f64; LANES];

    /// 1.5 · 2^52: adding it rounds to an integer in the low bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;

    /// e^x; x beyond ±700 is taken as ±700.
    #[inline(always)]
    pub fn exp<const FUSED: bool>(x: f64) -> f64 {
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
    pub fn ln<const FUSED: bool>(x: f64) -> f64 {
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
    pub fn product(a: &Lane, b: &Lane) -> Lane {
        let mut product = *a;
        for (a, b) in product.iter_mut().zip(b) {
            *a *= b;
        }
        product
    }

    /// a b + c.
    #[inline(always)]
    pub fn fused<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
        if FUSED { a.mul_add(b, c) } else { a * b + c }
    }
}

// Least squares by Householder reflections.

/// Relative size below which a pivot counts as zero.
const RANK_TOLERANCE: f64 = 1e-10;

/// The least-squares solution of X c ≈ y.
#[derive(Clone, Debug)]
pub struct LeastSquares {
    pub coefficients: Vec<f64>,
    /// Residual sum of squares.
    pub rss: f64,
    /// Rows minus coefficients.
    pub dof: usize,
    /// R of X = QR, column by column, `dof + p` values each; entries below its diagonal are not read.
    r: Vec<f64>,
}

/// Solves X c ≈ y for the rows of X; `None` if the rows do not determine every coefficient.
///
/// Householder's QR works on X itself, so the error grows with the condition of X and not, as for
/// the normal equations, with its square.
pub fn least_squares(rows: &[Vec<f64>], y: &[f64]) -> Option<LeastSquares> {
    assert_eq!(rows.len(), y.len(), "one value for each row");
    let (n, p) = (rows.len(), rows.first()?.len());
    if n < p {
        return None;
    }
    // Columns of X, and y as a last one, which comes out as Qᵀy.
    let mut columns: Vec<f64> = Vec::with_capacity(n * (p + 1));
    (0..p).for_each(|j| columns.extend(rows.iter().map(|row| row[j])));
    columns.extend(y);
    (0..p).try_for_each(|j| reflect(&mut columns, n, j))?;
    let y = &columns[n * p..];
    let coefficients = back_substitute(&columns, y, p);
    let rss = y[p..].iter().map(|y| y.powi(2)).sum();
    columns.truncate(n * p);
    Some(LeastSquares { coefficients, rss, dof: n - p, r: columns })
}

/// Clears column `j` of `n` values below the diagonal; `None` if it depends on earlier columns.
fn reflect(columns: &mut [f64], n: usize, j: usize) -> Option<()> {
    let (column, rest) = columns[n * j..].split_at_mut(n);
    let size = |values: &[f64]| values.iter().map(|x| x.powi(2)).sum::<f64>().sqrt();
    let norm = size(&column[j..]);
    if norm <= RANK_TOLERANCE * size(column) || !norm.is_finite() {
        return None;
    }
    let alpha = -norm.copysign(column[j]);
    column[j] -= alpha;
    let v = &column[j..];
    let vv: f64 = v.iter().map(|v| v * v).sum();
    for other in rest.chunks_exact_mut(n) {
        let other = &mut other[j..];
        let dot: f64 = v.iter().zip(&*other).map(|(v, x)| v * x).sum();
        other.iter_mut().zip(v).for_each(|(x, v)| *x -= 2.0 * dot / vv * v);
    }
    column[j] = alpha;
    Some(())
}

fn back_substitute(columns: &[f64], y: &[f64], p: usize) -> Vec<f64> {
    let n = y.len();
    let mut c = vec![0.0; p];
    for j in (0..p).rev() {
        let known: f64 = (j + 1..p).map(|k| columns[n * k + j] * c[k]).sum();
        c[j] = (y[j] - known) / columns[n * j + j];
    }
    c
}

impl LeastSquares {
    /// Standard error of gᵀc for noise of unit standard deviation: ‖R⁻ᵀg‖.
    pub fn unit_error(&self, g: &[f64]) -> f64 {
        let n = self.dof + g.len();
        let mut w: Vec<f64> = Vec::with_capacity(g.len());
        for (j, g) in g.iter().enumerate() {
            let known: f64 = (0..j).map(|k| self.r[n * j + k] * w[k]).sum();
            w.push((g - known) / self.r[n * j + j]);
        }
        w.iter().map(|w| w * w).sum::<f64>().sqrt()
    }
}

// Systems of a handful of equations, on the stack.

/// The first `n` entries of the solution of (M + `damping` I) s = b by Cholesky, from the lower half of M;
/// none if that matrix is not positive definite.
pub(in crate::laws) fn solve<const N: usize>(
    m: &[[f64; N]; N],
    damping: f64,
    b: &[f64; N],
    n: usize,
) -> Option<[f64; N]> {
    let factor = cholesky(m, damping, n)?;
    let mut s = *b;
    for i in 0..n {
        let known: f64 = (0..i).map(|j| factor[i][j] * s[j]).sum();
        s[i] = (s[i] - known) / factor[i][i];
    }
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|j| factor[j][i] * s[j]).sum();
        s[i] = (s[i] - known) / factor[i][i];
    }
    Some(s)
}

fn cholesky<const N: usize>(m: &[[f64; N]; N], damping: f64, n: usize) -> Option<[[f64; N]; N]> {
    let mut factor = [[0.0; N]; N];
    for i in 0..n {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
            let rest = m[i][j] + if i == j { damping } else { 0.0 } - known;
            if i == j {
                let floor = 1e-14 * (m[i][i].abs() + damping);
                if rest.is_nan() || rest <= floor {
                    return None;
                }
                factor[i][i] = rest.sqrt();
            } else {
                factor[i][j] = rest / factor[j][j];
            }
        }
    }
    Some(factor)
}

#[cfg(test)]
mod tests {
    use super::lanes::{exp, ln};
    use super::text::{count, short, times};
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_worked_regression_is_reproduced() {
        // x 1..=4, y 6, 5, 7, 10: y = 3.5 + 1.4 x, RSS 4.2, (XᵀX)⁻¹ of the slope 1/5.
        let rows: Vec<_> = (1..=4).map(|x| vec![1.0, f64::from(x)]).collect();
        let fit = least_squares(&rows, &[6.0, 5.0, 7.0, 10.0]).unwrap();
        assert!((fit.coefficients[0] - 3.5).abs() < 1e-13);
        assert!((fit.coefficients[1] - 1.4).abs() < 1e-13);
        assert!((fit.rss - 4.2).abs() < 1e-12);
        assert_eq!(fit.dof, 2);
        assert!((fit.unit_error(&[0.0, 1.0]) - 0.2f64.sqrt()).abs() < 1e-13);
    }

    #[test]
    fn dependent_columns_have_no_solution() {
        let rows: Vec<_> = (1..=5).map(|x| vec![f64::from(x), 2.0 * f64::from(x)]).collect();
        assert!(least_squares(&rows, &[1.0; 5]).is_none());
        assert!(least_squares(&[vec![1.0, 2.0]], &[1.0]).is_none());
        assert!(least_squares(&[], &[]).is_none());
    }

    #[test]
    fn a_solution_solves_and_an_indefinite_matrix_is_refused() {
        let mut m = [[0.0; 3]; 3];
        (m[0][0], m[0][1], m[1][0], m[1][1]) = (4.0, 1.0, 1.0, 3.0);
        let mut b = [0.0; 3];
        (b[0], b[1]) = (1.0, 2.0);
        let s = solve(&m, 0.0, &b, 2).unwrap();
        let back = [0, 1].map(|i| m[i][0] * s[0] + m[i][1] * s[1]);
        assert!((back[0] - 1.0).abs() < 1e-15 && (back[1] - 2.0).abs() < 1e-15);
        m[1][1] = -3.0;
        assert_eq!(solve(&m, 0.0, &b, 2), None);
        assert!(solve(&m, 5.0, &b, 2).is_some());
    }

    #[test]
    fn numbers_lose_trailing_zeros_only() {
        assert_eq!(count(1e10), "1e10");
        assert_eq!(count(1.2154e18), "1.215e18");
        assert_eq!(short(200.0, 2), "2e2");
        assert_eq!(short(1.9999e3, 2), "2e3");
    }

    #[test]
    fn factors_have_two_digits_and_three_below_two() {
        let factors = [1.04, 1.6, 9.375, 93.75, 312.5, 10.0].map(times);
        assert_eq!(factors, ["1.04", "1.6", "9.4", "94", "310", "10"]);
    }

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
