//! Power laws by a straight line in logarithms (ScaMo Eqs. 9 and 10).

use crate::laws::maths::engine::{Line, Points, least_squares_line};
use crate::laws::maths::stats::{SD_PER_MAD, interval95, quantile, r2};
use serde::{Deserialize, Serialize};
use std::f64::consts::LN_10;

/// log10 y = `log10_coefficient` + `exponent` · log10 x.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PowerLaw {
    pub log10_coefficient: f64,
    pub exponent: f64,
    /// ln y at the reference budget of [`Laws::reference_flops`](crate::laws::Laws::reference_flops); the well-determined intercept.
    /// For N_v in N_nv it is ln N_v at the geometric mean of the fitted N_nv.
    pub ln_at_reference: f64,
    /// 1 − RSS/TSS in ln y; 0 if y does not vary, and where a published law gives none (`n` 0).
    pub r2: f64,
    /// 95 % bootstrap percentile interval; absent if too few points allow none.
    pub exponent_ci95: Option<[f64; 2]>,
    pub ln_at_reference_ci95: Option<[f64; 2]>,
    pub log10_coefficient_ci95: Option<[f64; 2]>,
    /// Points fitted; 0 for a published law.
    pub n: usize,
}

impl PowerLaw {
    /// y at x by the coefficient and the exponent alone.
    pub fn value_at(&self, x: f64) -> f64 {
        10f64.powf(self.log10_coefficient + self.exponent * x.log10())
    }

    /// R², with more than two points.
    pub fn told_r2(&self) -> Option<f64> {
        (self.n > 2).then_some(self.r2)
    }

    /// Sets the interval of each coefficient; `coefficients` holds ln y at C0 and the exponent of each replicate.
    pub(in crate::laws) fn set_intervals(
        &mut self,
        coefficients: &[(f64, f64)],
        ln_reference: f64,
    ) {
        let interval =
            |value: &dyn Fn(&(f64, f64)) -> f64| interval95(coefficients.iter().map(value));
        self.exponent_ci95 = interval(&|(_, exponent)| *exponent);
        self.ln_at_reference_ci95 = interval(&|(level, _)| *level);
        self.log10_coefficient_ci95 =
            interval(&|(level, exponent)| (level - exponent * ln_reference) / LN_10);
    }
}

/// The power law y = y(x0) (x/x0)^exponent through points, least squares in ln y, x0 being
/// `reference`.
///
/// `weights` has one positive number per point. With `huber`, its δ in units of the residuals' scaled MAD, distant
/// points count linearly; see [`crate::laws::input::FitOptions::huber`]. `None` with fewer than two points or if x
/// does not vary. All values must be positive.
pub fn power_law(
    x: &[f64],
    y: &[f64],
    reference: f64,
    weights: &[f64],
    huber: Option<f64>,
) -> Option<PowerLaw> {
    let ln = |v: &[f64]| v.iter().map(|v| v.ln()).collect::<Vec<_>>();
    let (x, y) = (ln(x), ln(y));
    let line = match huber {
        Some(delta) => huber_line(&x, &y, weights, delta)?,
        None => least_squares_line(&x, &y, weights)?,
    };
    Some(from_line(&line, &x, &y, reference, weights))
}

/// The law of a line in natural logarithms.
pub(super) fn from_line(
    line: &Line,
    ln_x: &[f64],
    ln_y: &[f64],
    reference: f64,
    weights: &[f64],
) -> PowerLaw {
    let fitted: Vec<f64> = ln_x.iter().map(|x| line.at(*x)).collect();
    PowerLaw {
        log10_coefficient: line.at(0.0) / LN_10,
        exponent: line.slope,
        ln_at_reference: line.at(reference.ln()),
        r2: r2(ln_y, &fitted, weights),
        n: ln_x.len(),
        ..PowerLaw::default()
    }
}

// Huber's line by iteratively reweighted least squares.
//
// Minimises Σ w ρ((y − line)/s), ρ(r) = r²/2 up to δ and δ(|r| − δ/2) beyond. The scale s is
// 1.4826 times the median absolute residual of the Theil-Sen line, which up to 29 % of arbitrary
// points cannot move, and stays fixed: the objective is then convex, so the iteration finds its
// one minimum from any start.

/// Huber's line with `delta` in units of the scaled MAD; none if x does not vary.
///
/// If more than half of the points lie on the Theil-Sen line, so that s is 0, that line is returned: it is the limit
/// of Huber's as s → 0.
fn huber_line(x: &[f64], y: &[f64], weights: &[f64], delta: f64) -> Option<Line> {
    let line = theil_sen(x, y)?;
    let scale = SD_PER_MAD * median_residual(&line, x, y);
    let magnitude = y.iter().fold(0.0f64, |m, y| m.max(y.abs()));
    if scale <= 4.0 * f64::EPSILON * magnitude {
        return Some(line);
    }
    Some(Points::new(x, y, weights)?.huber_line(&line, delta * scale))
}

/// The line whose slope is the median over pairs, and whose level is the median residual.
fn theil_sen(x: &[f64], y: &[f64]) -> Option<Line> {
    let pairs = (0..x.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    let slopes: Vec<f64> =
        pairs.filter(|(i, j)| x[*i] != x[*j]).map(|(i, j)| (y[i] - y[j]) / (x[i] - x[j])).collect();
    let slope = quantile(&slopes, 0.5)?;
    let centre = x.iter().sum::<f64>() / x.len() as f64;
    let levels: Vec<f64> = x.iter().zip(y).map(|(x, y)| y - slope * (x - centre)).collect();
    Some(Line { centre, level: quantile(&levels, 0.5)?, slope })
}

fn median_residual(line: &Line, x: &[f64], y: &[f64]) -> f64 {
    let residuals: Vec<f64> = x.iter().zip(y).map(|(x, y)| (y - line.at(*x)).abs()).collect();
    quantile(&residuals, 0.5).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn exact_points_give_back_the_law(
            exponent in -2.0..2.0f64,
            log10_coefficient in -6.0..6.0f64,
            start in 8.0..20.0f64,
            steps in proptest::collection::vec(0.1..1.5f64, 1..6),
            huber in proptest::option::of(0.1..3.0f64),
        ) {
            let log10_x: Vec<f64> = steps.iter().scan(start, |x, step| { *x += step; Some(*x) })
                .chain([start]).collect();
            let x: Vec<f64> = log10_x.iter().map(|x| 10f64.powf(*x)).collect();
            let y: Vec<f64> =
                log10_x.iter().map(|x| 10f64.powf(log10_coefficient + exponent * x)).collect();
            let law = power_law(&x, &y, 1e15, &vec![1.0; x.len()], huber).unwrap();
            prop_assert!((law.exponent - exponent).abs() < 1e-10);
            prop_assert!((law.log10_coefficient - log10_coefficient).abs() < 1e-9);
            let at_reference = (log10_coefficient + 15.0 * exponent) * LN_10;
            prop_assert!((law.ln_at_reference - at_reference).abs() < 1e-9);
            prop_assert!((law.value_at(x[0]) / y[0] - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn one_abscissa_gives_no_law() {
        assert_eq!(power_law(&[1e18, 1e18], &[1.0, 2.0], 1e18, &[1.0, 1.0], None), None);
        assert_eq!(power_law(&[1e18], &[1.0], 1e18, &[1.0], None), None);
        assert_eq!(power_law(&[], &[], 1e18, &[], Some(1.0)), None);
    }

    #[test]
    fn a_point_of_double_weight_counts_as_two() {
        let (x, y) = ([1e10, 1e11, 1e12], [2.0, 5.0, 9.0]);
        let weighted = power_law(&x, &y, 1e11, &[1.0, 1.0, 2.0], None).unwrap();
        let repeated =
            power_law(&[x[0], x[1], x[2], x[2]], &[y[0], y[1], y[2], y[2]], 1e11, &[1.0; 4], None)
                .unwrap();
        assert!((weighted.exponent - repeated.exponent).abs() < 1e-14);
        assert!((weighted.r2 - repeated.r2).abs() < 1e-14);
    }

    const X: [f64; 8] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
    const NOISE: [f64; 8] = [0.01, -0.02, 0.015, 0.0, -0.01, 0.02, -0.015, 0.005];

    fn points(outlier: f64) -> Vec<f64> {
        let mut y: Vec<f64> = X.iter().zip(NOISE).map(|(x, e)| 3.0 + 0.5 * x + e).collect();
        y[7] += outlier;
        y
    }

    #[test]
    fn one_wild_point_hardly_moves_the_line() {
        let robust = huber_line(&X, &points(5.0), &[1.0; 8], 1.345).unwrap();
        let plain = least_squares_line(&X, &points(5.0), &[1.0; 8]).unwrap();
        assert!((robust.slope - 0.5).abs() < 0.01, "{}", robust.slope);
        assert!((plain.slope - 0.5).abs() > 0.3, "{}", plain.slope);
    }

    #[test]
    fn the_gradient_of_the_objective_vanishes_at_the_line() {
        let (y, delta) = (points(5.0), 1.345);
        let line = huber_line(&X, &y, &[1.0; 8], delta).unwrap();
        let scale = SD_PER_MAD * median_residual(&theil_sen(&X, &y).unwrap(), &X, &y);
        let psi = |i: usize| ((y[i] - line.at(X[i])) / scale).clamp(-delta, delta);
        let along: [f64; 2] = [(0..8).map(psi).sum(), (0..8).map(|i| psi(i) * X[i]).sum()];
        assert!(along.iter().all(|g| g.abs() < 1e-9), "{along:?}");
    }

    #[test]
    fn a_wide_delta_is_least_squares() {
        let robust = huber_line(&X, &points(0.3), &[1.0; 8], 1e6).unwrap();
        let plain = least_squares_line(&X, &points(0.3), &[1.0; 8]).unwrap();
        assert!((robust.slope - plain.slope).abs() < 1e-12);
    }
}
