//! Small statistics and draws that several steps share.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::Serialize;
use std::borrow::Borrow;

/// The 97.5th percentile of the normal distribution.
pub(in crate::laws) const NORMAL_97_5: f64 = 1.959_964;

/// Percentile intervals need the 2.5 % tails to hold at least one replicate.
pub const MIN_REPLICATES: usize = 40;

/// The standard deviation of normal numbers in units of their median absolute deviation.
pub const SD_PER_MAD: f64 = 1.4826;

/// The sample's standard deviation; 0 for fewer than two values.
pub fn standard_deviation(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    if values.len() < 2 { 0.0 } else { (squares / (n - 1.0)).sqrt() }
}

/// The different values among some, ascending.
pub fn distinct(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}

/// The smallest and the largest of some values.
pub fn extent(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
}

/// Σ a b.
pub(in crate::laws) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The geometric mean.
pub(in crate::laws) fn geometric_mean(values: impl IntoIterator<Item: Borrow<f64>>) -> f64 {
    let logs: Vec<f64> = values.into_iter().map(|value| value.borrow().ln()).collect();
    (logs.iter().sum::<f64>() / logs.len() as f64).exp()
}

/// The quantile at `p` in 0..=1 by linear interpolation between order statistics (R's type 7);
/// none for no values.
pub fn quantile(values: &[f64], p: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    Some(at_rank(&sorted, p * sorted.len().checked_sub(1)? as f64))
}

/// The 95 % percentile interval; none from fewer than forty values, or where an end is not finite.
///
/// Its ends have rank p(n + 1) (R's type 6): a further value falls between them with a probability of
/// 95 % for every n, where type 7 gives 94 % for 200 values.
pub fn interval95(values: impl IntoIterator<Item: Borrow<f64>>) -> Option<[f64; 2]> {
    let mut sorted: Vec<f64> = values.into_iter().map(|value| *value.borrow()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    if sorted.len() < MIN_REPLICATES {
        return None;
    }
    let end = |p: f64| at_rank(&sorted, p * (sorted.len() + 1) as f64 - 1.0);
    Some([end(0.025), end(0.975)]).filter(|ends| ends.iter().all(|end| end.is_finite()))
}

/// The value at a rank counted from 0, interpolated if it is no integer.
fn at_rank(sorted: &[f64], rank: f64) -> f64 {
    let (below, above) = (sorted[rank.floor() as usize], sorted[rank.ceil() as usize]);
    below + (rank - rank.floor()) * (above - below)
}

/// 1 − RSS/TSS with weights; 0 if y does not vary.
pub(in crate::laws) fn r2(y: &[f64], fitted: &[f64], weights: &[f64]) -> f64 {
    let total: f64 = weights.iter().sum();
    let mean = weights.iter().zip(y).map(|(w, y)| w * y).sum::<f64>() / total;
    let tss: f64 = weights.iter().zip(y).map(|(w, y)| w * (y - mean).powi(2)).sum();
    let rss: f64 = y.iter().zip(fitted).zip(weights).map(|((y, f), w)| w * (y - f).powi(2)).sum();
    if tss > 0.0 { 1.0 - rss / tss } else { 0.0 }
}

/// Akaike's criterion n ln(RSS/n) + 2(k + 1) of a least-squares fit of k coefficients, the noise's
/// variance being one more.
///
/// RSS is floored at the rounding of y, so that an exact fit gives a finite number.
pub(in crate::laws) fn aic(y: &[f64], fitted: &[f64], coefficients: usize) -> f64 {
    let n = y.len() as f64;
    let rss: f64 = y.iter().zip(fitted).map(|(y, f)| (y - f).powi(2)).sum();
    let largest = y.iter().fold(f64::MIN_POSITIVE.sqrt(), |m, y| m.max(y.abs()));
    let rounding = (f64::EPSILON * largest).powi(2).max(f64::MIN_POSITIVE);
    n * (rss / n).max(rounding).ln() + 2.0 * (coefficients as f64 + 1.0)
}

/// The two-sided 95 % point of Student's t, for `dof` ≥ 1.
///
/// Tabled to 5 degrees of freedom, beyond by the Cornish-Fisher expansion around the normal point
/// (Abramowitz & Stegun 26.7.5), within 0.002 of the exact value.
pub fn student_t95(dof: usize) -> f64 {
    const TABLE: [f64; 5] = [12.7062, 4.3027, 3.1824, 2.7764, 2.5706];
    assert!(dof >= 1, "Student's t needs a degree of freedom");
    if let Some(tabled) = TABLE.get(dof - 1) {
        return *tabled;
    }
    let (nu, z) = (dof as f64, NORMAL_97_5);
    let z2 = z * z;
    let first = z * (z2 + 1.0) / 4.0;
    let second = z * ((5.0 * z2 + 16.0) * z2 + 3.0) / 96.0;
    let third = z * (((3.0 * z2 + 19.0) * z2 + 17.0) * z2 - 15.0) / 384.0;
    z + first / nu + second / nu.powi(2) + third / nu.powi(3)
}

/// The probability that a sum of squares of `dof` normal numbers exceeds `chi2`, with the numbers in units of a
/// standard deviation that is itself estimated with `scale_dof` degrees of freedom.
///
/// It is the tail of Snedecor's F at χ²/ν, by Paulson's normal approximation (Abramowitz & Stegun
/// 26.6.15), right to two digits above 1e-4.
pub fn chi_square_tail(chi2: f64, dof: usize, scale_dof: usize) -> f64 {
    let (a, b) = (2.0 / (9.0 * dof as f64), 2.0 / (9.0 * scale_dof as f64));
    let root = (chi2 / dof as f64).cbrt();
    let z = (root * (1.0 - b) - (1.0 - a)) / (root.powi(2) * b + a).sqrt();
    0.5 * libm::erfc(z / std::f64::consts::SQRT_2)
}

// Whether two studies differ beyond their intervals.

/// A value with its interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    pub value: f64,
    pub ci95: Option<[f64; 2]>,
}

/// One estimate less another of an independent study.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Difference {
    pub value: f64,
    /// `None` if one has no interval.
    pub ci95: Option<[f64; 2]>,
    /// Whether the interval leaves out zero.
    pub differs: Option<bool>,
}

impl Difference {
    /// `a − b`, with the interval that follows from theirs (Zou and Donner 2008, MOVER): each end takes the
    /// root of the squared distances that point its way, so that intervals need not be symmetric.
    pub fn of(a: Estimate, b: Estimate) -> Self {
        let value = a.value - b.value;
        let ci95 = a.ci95.zip(b.ci95).map(|([a_low, a_high], [b_low, b_high])| {
            let down = (a.value - a_low).hypot(b_high - b.value);
            let up = (a_high - a.value).hypot(b.value - b_low);
            [value - down, value + up]
        });
        Self { value, ci95, differs: ci95.map(|[low, high]| low > 0.0 || high < 0.0) }
    }
}

impl Estimate {
    /// The same on a logarithmic scale, for ratios.
    pub fn ln(self) -> Self {
        Self { value: self.value.ln(), ci95: self.ci95.map(|ends| ends.map(f64::ln)) }
    }
}

// Draws from ChaCha8, the same on every machine.

/// Above this many degrees of freedom χ² is drawn by Wilson and Hilferty's approximation, whose
/// quantiles are then right to three digits; up to it, as a sum of squares.
const EXACT_DOF: usize = 30;

/// A stream of normal numbers.
pub struct Normals {
    rng: ChaCha8Rng,
    spare: Option<f64>,
}

impl Normals {
    /// Stream `stream` of `seed`: streams do not overlap, so the draws of a replicate do not depend on order or
    /// thread.
    pub fn of_stream(seed: u64, stream: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream);
        Self { rng, spare: None }
    }

    /// A standard normal by Box and Muller, both of whose numbers are used.
    pub fn draw(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        let (sin, cos) = (std::f64::consts::TAU * self.uniform()).sin_cos();
        self.spare = Some(radius * sin);
        radius * cos
    }

    /// A χ² of `dof` degrees of freedom.
    pub fn chi_square(&mut self, dof: usize) -> f64 {
        if dof <= EXACT_DOF {
            return (0..dof).map(|_| self.draw().powi(2)).sum();
        }
        let variance = 2.0 / (9.0 * dof as f64);
        dof as f64 * (1.0 - variance + variance.sqrt() * self.draw()).powi(3)
    }

    /// A uniform number in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        (self.rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// A uniform index below `n` by Lemire's multiplication; its bias, n/2⁶⁴, is below any rounding.
pub(in crate::laws) fn below(rng: &mut ChaCha8Rng, n: usize) -> usize {
    ((u128::from(rng.next_u64()) * n as u128) >> 64) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_interpolate_between_order_statistics() {
        assert_eq!(quantile(&[3.0, 1.0, 2.0, 4.0], 0.5), Some(2.5));
        assert_eq!(quantile(&[5.0], 0.975), Some(5.0));
        assert_eq!(quantile(&[], 0.5), None);
    }

    #[test]
    fn interval_ends_cut_a_fortieth_of_all_ranks() {
        let ramp: Vec<f64> = (1..=199).map(f64::from).collect();
        let [low, high] = interval95(&ramp).unwrap();
        assert!((low - 5.0).abs() < 1e-9 && (high - 195.0).abs() < 1e-9, "{low}..{high}");
        assert_eq!(interval95(&ramp[..39]), None);
        assert!(interval95(&ramp[..40]).is_some());
    }

    #[test]
    fn an_interval_has_finite_ends_or_there_is_none() {
        let values: Vec<f64> = (0..100).map(f64::from).collect();
        assert!(interval95(&values).is_some());
        let mut endless = values;
        endless[..9].fill(f64::NEG_INFINITY);
        assert_eq!(interval95(&endless), None);
        assert_eq!(interval95([f64::NAN; 60]), None);
    }

    #[test]
    fn student_points_agree_with_published_tables() {
        for (dof, t) in
            [(1, 12.706), (5, 2.571), (6, 2.447), (10, 2.228), (30, 2.042), (120, 1.980)]
        {
            assert!((student_t95(dof) - t).abs() < 2e-3, "{dof}: {}", student_t95(dof));
        }
    }

    #[test]
    fn tails_agree_with_published_tables() {
        let exact = 1_000_000;
        let tabled = [(3.841, 1, exact, 0.05), (9.210, 2, exact, 0.01), (33.41, 17, exact, 0.01)];
        let of_f = [(2.0 * 4.103, 2, 10, 0.05), (5.0 * 3.326, 5, 10, 0.05)];
        for (chi2, dof, scale_dof, p) in tabled.into_iter().chain(of_f) {
            let found = chi_square_tail(chi2, dof, scale_dof);
            assert!((found / p - 1.0).abs() < 0.2, "{chi2} {dof} {scale_dof}: {found}");
        }
        assert!(chi_square_tail(75.0, 17, 200) < 1e-5);
    }

    #[test]
    fn an_exact_fit_has_a_finite_criterion() {
        assert!(aic(&[-1.0, -2.0, -3.0], &[-1.0, -2.0, -3.0], 2).is_finite());
        assert!(aic(&[0.0, 0.0], &[0.0, 0.0], 2).is_finite());
    }

    fn estimate(value: f64, low: f64, high: f64) -> Estimate {
        Estimate { value, ci95: Some([low, high]) }
    }

    #[test]
    fn alike_intervals_give_the_root_of_two() {
        let found = Difference::of(estimate(1.0, 0.9, 1.1), estimate(0.7, 0.6, 0.8));
        let [low, high] = found.ci95.unwrap();
        assert!((found.value - 0.3).abs() < 1e-12 && found.differs == Some(true));
        assert!((low - (0.3 - 0.1 * 2f64.sqrt())).abs() < 1e-12);
        assert!((high - (0.3 + 0.1 * 2f64.sqrt())).abs() < 1e-12);
    }

    #[test]
    fn each_end_sees_the_arms_that_point_its_way() {
        let found = Difference::of(estimate(1.0, 1.0, 1.3), estimate(0.8, 0.4, 0.8));
        assert_eq!(found.ci95.map(|[low, _]| low), Some(0.2_f64.min(found.value)));
        assert!((found.ci95.unwrap()[1] - 0.7).abs() < 1e-12);
        let apart = Difference::of(estimate(1.0, 0.5, 1.5), estimate(0.8, 0.7, 0.9));
        assert_eq!(apart.differs, Some(false));
    }

    #[test]
    fn without_an_interval_nothing_is_said() {
        let bare = Estimate { value: 1.0, ci95: None };
        let found = Difference::of(bare, estimate(0.8, 0.7, 0.9));
        assert_eq!((found.ci95, found.differs), (None, None));
    }

    #[test]
    fn normals_and_chi_squares_have_their_moments() {
        let mut normals = Normals::of_stream(0, 0);
        let moments = |draws: &[f64]| {
            let mean = draws.iter().sum::<f64>() / draws.len() as f64;
            let variance = draws.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
            (mean, variance / draws.len() as f64)
        };
        let draws: Vec<f64> = (0..40_000).map(|_| normals.draw()).collect();
        let (mean, variance) = moments(&draws);
        assert!(mean.abs() < 0.02 && (variance - 1.0).abs() < 0.03, "{mean} {variance}");
        for dof in [4, 60] {
            let draws: Vec<f64> = (0..40_000).map(|_| normals.chi_square(dof)).collect();
            let (mean, variance) = moments(&draws);
            assert!((mean / dof as f64 - 1.0).abs() < 0.02, "{dof}: {mean}");
            assert!((variance / (2.0 * dof as f64) - 1.0).abs() < 0.05, "{dof}: {variance}");
        }
    }

    #[test]
    fn a_stream_is_the_same_every_time_and_unlike_its_neighbour() {
        let first = |seed, stream| Normals::of_stream(seed, stream).draw();
        assert_eq!(first(1, 2), first(1, 2));
        assert_ne!(first(1, 2), first(1, 3));
        assert_ne!(first(1, 2), first(2, 2));
    }
}
