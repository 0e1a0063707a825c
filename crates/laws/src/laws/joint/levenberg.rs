//! Least squares of a smooth model by Levenberg and Marquardt's damped steps.

use crate::laws::maths::cholesky::solve;

/// Coefficients at most.
pub(super) const MOST: usize = 12;
/// A number for each coefficient, and zeros after the last.
pub(super) type Row = [f64; MOST];

/// Steps until a search is given up.
pub(super) const MOST_STEPS: usize = 200;
/// Relative fall of the sum of squares below which a step counts as none.
const DONE: f64 = 1e-12;
const MOST_DAMPING: f64 = 1e12;

/// Residuals of a model.
pub(super) trait Residuals {
    /// The sum of their squares.
    fn sum(&self, values: &[f64]) -> f64;
    /// Tells `take` every residual, and minus its derivatives.
    fn each(&self, values: &[f64], take: &mut dyn FnMut(f64, &Row));
    /// Moves values that left their bounds back onto them.
    fn bound(&self, values: &mut [f64]);
}

/// The values of the least sum of squares downhill from `start`, after at most `most_steps` steps, and
/// that sum.
pub(super) fn minimise(
    problem: &impl Residuals,
    start: Vec<f64>,
    most_steps: usize,
) -> (Vec<f64>, f64) {
    let (mut values, mut damping) = (start, 1e-3);
    let mut least = problem.sum(&values);
    for _ in 0..most_steps {
        let normal = Normal::of(problem, &values);
        let mut fell = None;
        while fell.is_none() && damping < MOST_DAMPING {
            if let Some(next) = normal.step(problem, &values, damping) {
                let there = problem.sum(&next);
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

/// JᵀJ, below and on its diagonal, and Jᵀr.
struct Normal {
    matrix: [Row; MOST],
    right: Row,
}

impl Normal {
    fn of(problem: &impl Residuals, values: &[f64]) -> Self {
        let mut own = Self { matrix: [[0.0; MOST]; MOST], right: [0.0; MOST] };
        problem.each(values, &mut |residual, slopes| {
            for (i, slope) in slopes.iter().enumerate().take(values.len()) {
                own.right[i] += slope * residual;
                let row = own.matrix[i].iter_mut().zip(slopes).take(i + 1);
                row.for_each(|(sum, other)| *sum += slope * other);
            }
        });
        own
    }

    /// The values after a step damped in units of each column's length.
    fn step(&self, problem: &impl Residuals, values: &[f64], damping: f64) -> Option<Vec<f64>> {
        let p = values.len();
        let mut matrix = self.matrix;
        (0..p).for_each(|i| matrix[i][i] += damping * matrix[i][i].max(1e-18));
        let change = solve(&matrix, 0.0, &self.right, p)?;
        let mut next: Vec<f64> = values.iter().zip(change).map(|(v, step)| v + step).collect();
        problem.bound(&mut next);
        next.iter().all(|value| value.is_finite()).then_some(next)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y = a e^(−b x) at some x, b held above 0.1.
    struct Decay(Vec<(f64, f64)>);

    impl Residuals for Decay {
        fn sum(&self, v: &[f64]) -> f64 {
            self.0.iter().map(|(x, y)| (y - v[0] * (-v[1] * x).exp()).powi(2)).sum()
        }

        fn each(&self, v: &[f64], take: &mut dyn FnMut(f64, &Row)) {
            for (x, y) in &self.0 {
                let e = (-v[1] * x).exp();
                let mut row = [0.0; MOST];
                (row[0], row[1]) = (e, -v[0] * x * e);
                take(y - v[0] * e, &row);
            }
        }

        fn bound(&self, values: &mut [f64]) {
            values[1] = values[1].max(0.1);
        }
    }

    fn decay(a: f64, b: f64) -> Decay {
        Decay((0..20).map(|i| 0.3 * f64::from(i)).map(|x| (x, a * (-b * x).exp())).collect())
    }

    #[test]
    fn known_coefficients_are_found_from_afar() {
        let (values, sum) = minimise(&decay(3.0, 0.7), vec![0.1, 4.0], MOST_STEPS);
        assert!((values[0] - 3.0).abs() < 1e-6 && (values[1] - 0.7).abs() < 1e-6, "{values:?}");
        assert!(sum < 1e-12);
    }

    #[test]
    fn bounds_hold() {
        let (values, _) = minimise(&decay(3.0, 0.01), vec![1.0, 1.0], MOST_STEPS);
        assert_eq!(values[1], 0.1);
    }
}
