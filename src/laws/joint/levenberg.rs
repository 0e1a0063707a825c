//! Least squares of a smooth model by Levenberg and Marquardt's damped steps.

use crate::laws::least_squares::least_squares;

const MOST_STEPS: usize = 200;
/// Relative fall of the sum of squares below which a step counts as none.
const DONE: f64 = 1e-12;

/// Residuals and their derivatives, a row a residual.
pub(super) trait Residuals {
    fn at(&self, values: &[f64]) -> Vec<f64>;
    /// Minus the residuals' derivatives.
    fn slopes(&self, values: &[f64]) -> Vec<Vec<f64>>;
    /// Moves values that left their bounds back onto them.
    fn bound(&self, values: &mut [f64]);
}

/// The values of the least sum of squares downhill from `start`, and that sum.
pub(super) fn minimise(problem: &impl Residuals, start: Vec<f64>) -> (Vec<f64>, f64) {
    let sum = |values: &[f64]| problem.at(values).iter().map(|r| r * r).sum::<f64>();
    let (mut values, mut damping) = (start, 1e-3);
    let mut least = sum(&values);
    for _ in 0..MOST_STEPS {
        let slopes = problem.slopes(&values);
        let residuals = problem.at(&values);
        let mut fell = None;
        while fell.is_none() && damping < 1e12 {
            if let Some(next) = step(problem, &values, &slopes, &residuals, damping) {
                let there = sum(&next);
                if there < least {
                    fell = Some((least - there) / least);
                    (values, least) = (next, there);
                    damping = (damping * 0.2).max(1e-12);
                    continue;
                }
            }
            damping *= 5.0;
        }
        if fell.is_none_or(|share| share < DONE) {
            break;
        }
    }
    (values, least)
}

/// The values after a step damped in units of each column's length.
fn step(
    problem: &impl Residuals,
    values: &[f64],
    slopes: &[Vec<f64>],
    residuals: &[f64],
    damping: f64,
) -> Option<Vec<f64>> {
    let p = values.len();
    let length = |j: usize| slopes.iter().map(|row| row[j] * row[j]).sum::<f64>().sqrt();
    let mut rows = slopes.to_vec();
    for j in 0..p {
        let mut row = vec![0.0; p];
        row[j] = damping.sqrt() * length(j).max(1e-9);
        rows.push(row);
    }
    let mut y = residuals.to_vec();
    y.resize(y.len() + p, 0.0);
    let change = least_squares(&rows, &y)?.coefficients;
    let mut next: Vec<f64> = values.iter().zip(change).map(|(value, step)| value + step).collect();
    problem.bound(&mut next);
    next.iter().all(|value| value.is_finite()).then_some(next)
}
