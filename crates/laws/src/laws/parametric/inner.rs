//! The inner problem of variable projection: constant and coefficients at fixed exponents.
//!
//! At fixed exponents the law is linear in E, A and B. Least squares with A, B ≥ 0 (and E ≥ 0
//! where it is a loss) is solved exactly, by trying which of them are zero; in logarithms the
//! residuals are taken relative to the loss, which agrees with them to first order.

use super::data::Data;
use super::objective::{Constant, Space};
use super::vector::{MAX_PARAMS, Matrix, Vector};
use crate::laws::maths::cholesky::solve;
use crate::laws::maths::stats::dot;

/// Columns of the linear problem: one a term, and the constant last.
pub(super) struct Basis {
    columns: Vec<Vec<f64>>,
    y: Vec<f64>,
}

impl Basis {
    /// e^(−α x) of each term at its exponent, divided by the loss in logarithms.
    pub fn new(data: &Data, space: Space, exponents: &[f64]) -> Self {
        let n = data.losses.len();
        let scale: Vec<f64> = (0..n).map(|i| scale(data, space, i)).collect();
        let term = |(x, exponent): (&Vec<f64>, &f64)| {
            x.iter().zip(&scale).map(|(x, scale)| scale * (-exponent * x).exp()).collect()
        };
        let mut columns: Vec<Vec<f64>> = data.columns.x.iter().zip(exponents).map(term).collect();
        let y = data.losses.iter().zip(&scale).map(|(l, scale)| l * scale).collect();
        columns.push(scale);
        Self { columns, y }
    }

    /// c_1 … c_K and the constant as parameters, by least squares under the signs; none where no
    /// set of columns can be solved.
    pub fn solve(&self, constant: Constant) -> Option<Vector> {
        let (gram, moments) = self.normal();
        let n = self.columns.len();
        let signed = if constant == Constant::Positive { n } else { n - 1 };
        let best = (0..1usize << signed)
            .filter_map(|zero| {
                let kept: Vec<usize> = (0..n).filter(|i| zero >> i & 1 == 0).collect();
                let values = self.on(&kept, &gram, &moments)?;
                let feasible = (0..signed).all(|i| values[i] >= 0.0);
                feasible.then(|| (gain(&gram, &moments, &values, n), values))
            })
            .max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(self.parameters(&best.1, constant))
    }

    fn normal(&self) -> (Matrix, Vector) {
        let mut gram = [[0.0; MAX_PARAMS]; MAX_PARAMS];
        let mut moments = [0.0; MAX_PARAMS];
        for (i, column) in self.columns.iter().enumerate() {
            moments[i] = dot(column, &self.y);
            for (j, other) in self.columns[..=i].iter().enumerate() {
                gram[i][j] = dot(column, other);
                gram[j][i] = gram[i][j];
            }
        }
        (gram, moments)
    }

    /// The solution on some columns, zero on the others.
    fn on(&self, kept: &[usize], gram: &Matrix, moments: &Vector) -> Option<Vector> {
        let mut part = [[0.0; MAX_PARAMS]; MAX_PARAMS];
        let mut right = [0.0; MAX_PARAMS];
        for (i, column) in kept.iter().enumerate() {
            right[i] = moments[*column];
            for (j, other) in kept.iter().enumerate() {
                part[i][j] = gram[*column][*other];
            }
        }
        let solution = solve(&part, 0.0, &right, kept.len())?;
        let mut values = [0.0; MAX_PARAMS];
        for (i, column) in kept.iter().enumerate() {
            values[*column] = solution[i];
        }
        Some(values)
    }

    /// Logarithms of the positive ones; zero stands as a millionth of the mean loss.
    fn parameters(&self, values: &Vector, constant: Constant) -> Vector {
        let n = self.columns.len();
        let typical = self.y.iter().map(|y| y.abs()).sum::<f64>() / self.y.len() as f64;
        let least = 1e-6 * typical.max(f64::MIN_POSITIVE);
        let mut theta = values.map(|v| v.max(least).ln());
        if constant == Constant::Free {
            theta[n - 1] = values[n - 1];
        }
        theta
    }
}

/// What a row's residual is multiplied by: its weight's root, over the loss in logarithms.
fn scale(data: &Data, space: Space, row: usize) -> f64 {
    let root = data.weights[row].sqrt();
    match space {
        Space::Log => root / data.losses[row],
        Space::Raw => root,
    }
}

/// How much the sum of squares falls from that of y: 2 b·m − b'Gb.
fn gain(gram: &Matrix, moments: &Vector, values: &Vector, n: usize) -> f64 {
    let bent = super::vector::times(gram, values, n);
    (0..n).map(|i| values[i] * (2.0 * moments[i] - bent[i])).sum()
}
