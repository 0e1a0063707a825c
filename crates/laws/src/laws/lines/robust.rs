//! Huber's line by iteratively reweighted least squares.
//!
//! Minimises Σ w ρ((y − line)/s), ρ(r) = r²/2 up to δ and δ(|r| − δ/2) beyond. The scale s is
//! 1.4826 times the median absolute residual of the Theil-Sen line, which up to 29 % of arbitrary
//! points cannot move, and stays fixed: the objective is then convex, so the iteration finds its
//! one minimum from any start.

use crate::laws::maths::line::{Line, Points};
use crate::laws::maths::stats::{SD_PER_MAD, quantile};

/// Huber's line with `delta` in units of the scaled MAD; none where x does not vary.
///
/// Where more than half of the points lie on the Theil-Sen line, so that s is 0, that line is the
/// answer: it is the limit of Huber's as s → 0.
pub(in crate::laws) fn huber_line(
    x: &[f64],
    y: &[f64],
    weights: &[f64],
    delta: f64,
) -> Option<Line> {
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
    use crate::laws::maths::line::least_squares_line;

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
