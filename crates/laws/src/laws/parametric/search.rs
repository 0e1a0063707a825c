//! The search for the optimum of a parametric law.
//!
//! By default by variable projection: over a grid of exponents the inner problem is solved exactly
//! and improved under the objective itself; the lowest grid points are the starts of the full search.
//! `Starts::Grid` takes instead the 4500 starts of Hoffmann et al. 2022 (approach 3), as Besiroglu et
//! al. 2024 list them.

use super::form::{Coefficients, Constant, MAX_PARAMS, Matrix, Slots, Space, Vector};
use super::newton::{EXACT, minimise, times};
use super::objective::Curvature;
use super::target::{Data, End, Target};
use crate::laws::maths::solve;
use crate::laws::maths::stats::dot;
use rayon::prelude::*;

/// The starts of a search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Starts {
    /// The best points of a grid of exponents, by variable projection.
    #[default]
    Projected,
    /// Hoffmann's grid: α, β in 0, 0.5 … 2, ln A, ln B in 0, 5 … 25, ln E in −1, −0.5 … 1.
    Grid,
}

/// Exponents of the grid; a factor of about 1.6 apart, from hardly falling to gone in a decade.
const EXPONENTS: [f64; 10] = [0.03, 0.06, 0.1, 0.16, 0.25, 0.4, 0.6, 0.9, 1.3, 2.0];
/// Starts of the full search.
const N_STARTS: usize = 16;
/// Rows that the grid looks at; more are thinned evenly.
const MAX_ROWS: usize = 2000;
/// Relative difference of two objectives that count as one optimum.
const SAME: f64 = 1e-8;

/// Difference of all parameters below which the descents of two starts have met.
const CLOSE: f64 = 1e-6;

/// Share of a loss, or of its logarithm, that counts as rounding.
const ROUNDING: f64 = 1e-9;

/// The best point found, and how the starts fared.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub end: End,
    pub starts: usize,
    pub starts_at_optimum: usize,
}

/// The optimum; `None` if no start leads to one.
///
/// For a large table, the starts descend on a part of its rows, and the whole table's optimum is searched only from
/// the best end; the reported fraction of starts is for the thinned rows.
pub(super) fn search(target: &Target, starts: Starts) -> Option<Found> {
    let thinned = thinned(target.data);
    let few = Target { data: &thinned, ..*target };
    let starts = match starts {
        Starts::Projected => projected(&few),
        Starts::Grid => hoffmann(&few),
    };
    let near: Vec<Vector> = starts.par_iter().filter_map(|start| few.approach(start)).collect();
    let (distinct, places) = distinct(&near);
    let reached: Vec<Option<End>> = distinct.par_iter().map(|at| few.descend(at)).collect();
    let ends: Vec<End> = places.into_iter().filter_map(|place| reached[place]).collect();
    let best = ends.iter().min_by(|a, b| a.minimised.value.total_cmp(&b.minimised.value))?;
    let lowest = few.settle(&best.theta, &thinned.weights, EXACT)?;
    let most = lowest.minimised.value * (1.0 + SAME) + rounding(&few);
    Some(Found {
        end: target.settle(&lowest.theta, &target.data.weights, EXACT)?,
        starts: starts.len(),
        starts_at_optimum: ends.iter().filter(|end| end.minimised.value <= most).count(),
    })
}

/// Points further apart than [`CLOSE`], and the place among them of each point.
fn distinct(points: &[Vector]) -> (Vec<Vector>, Vec<usize>) {
    let mut distinct: Vec<Vector> = Vec::new();
    let place = |point: &Vector| {
        let same = |other: &Vector| point.iter().zip(other).all(|(a, b)| (a - b).abs() <= CLOSE);
        distinct.iter().position(same).unwrap_or_else(|| {
            distinct.push(*point);
            distinct.len() - 1
        })
    };
    let places = points.iter().map(place).collect();
    (distinct, places)
}

/// The objective of rounding errors: if a law goes through all rows, every start ends below it, with different digits.
fn rounding(target: &Target) -> f64 {
    let largest = target.data.columns.y.iter().fold(0.0f64, |most, y| most.max(y.abs()));
    target.data.weights.iter().sum::<f64>() * (ROUNDING * largest).powi(2)
}

/// The lowest points of the grid of exponents.
fn projected(target: &Target) -> Vec<Vector> {
    let mut points: Vec<(f64, Vector)> = exponents(target.form.n_terms(), target.tied)
        .iter()
        .filter_map(|e| inner(target, e))
        .collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    points.into_iter().take(N_STARTS).map(|(_, theta)| theta).collect()
}

/// Every combination of exponents for `k` terms.
fn exponents(k: usize, tied: bool) -> Vec<Vec<f64>> {
    let free = if tied { k - 1 } else { k };
    let combination = |mut code: usize| {
        let mut chosen = Vec::with_capacity(k);
        for _ in 0..free {
            chosen.push(EXPONENTS[code % EXPONENTS.len()]);
            code /= EXPONENTS.len();
        }
        chosen.resize(k, chosen[0]);
        chosen
    };
    (0..EXPONENTS.len().pow(free as u32)).map(combination).collect()
}

/// The inner optimum at some exponents, and the objective there.
fn inner(target: &Target, exponents: &[f64]) -> Option<(f64, Vector)> {
    let k = target.form.n_terms();
    let basis = Basis::new(target.data, target.space, exponents);
    let mut theta = basis.solve(target.data.constant)?;
    theta[k + 1..=2 * k].copy_from_slice(exponents);
    let linear: Slots = std::array::from_fn(|p| (p <= k).then_some(p));
    let how = (10.0 * target.delta, Curvature::GaussNewton);
    let problem = target.problem(how, linear, theta, &target.data.weights);
    let end = minimise(problem, problem.free(&theta), 1e-2)?;
    Some((end.value, problem.full(&end.free)))
}

/// At most [`MAX_ROWS`] rows, evenly spread over the table.
fn thinned(data: &Data) -> Data {
    let n = data.columns.n;
    if n <= MAX_ROWS {
        return data.clone();
    }
    data.rows(&(0..MAX_ROWS).map(|i| i * n / MAX_ROWS).collect::<Vec<_>>())
}

/// Hoffmann's 4500 starts; a vocabulary term starts like the model's.
fn hoffmann(target: &Target) -> Vec<Vector> {
    let start = |i: usize| {
        let level = |place: usize, levels: usize| (i / place % levels) as f64;
        let [a, b] = [5.0 * level(750, 6), 5.0 * level(125, 6)].map(f64::exp);
        let e = (0.5 * level(25, 5) - 1.0).exp();
        let values = target.form.start([a, b, e, 0.5 * level(5, 5), 0.5 * level(1, 5)]);
        let own = Coefficients::new(target.form, &values).expect("as many values as names");
        own.centred(target.data.constant, &target.data.means)
    };
    (0..6 * 6 * 5 * 5 * 5).map(start).collect()
}

// The inner problem of variable projection: constant and coefficients at fixed exponents.
//
// At fixed exponents the law is linear in E, A and B. Least squares with A, B ≥ 0 (and E ≥ 0
// if it is a loss) is solved exactly, by trying which of them are zero; in logarithms the residuals are relative to
// the loss, which is equal to first order.

/// Columns of the linear problem: one a term, and the constant last.
struct Basis {
    columns: Vec<Vec<f64>>,
    y: Vec<f64>,
}

impl Basis {
    /// e^(−α x) of each term at its exponent, divided by the loss in logarithms.
    fn new(data: &Data, space: Space, exponents: &[f64]) -> Self {
        // The factor of a row's residual: the root of its weight, divided by the loss in logarithms.
        let scale = |(weight, loss): (&f64, &f64)| match space {
            Space::Log => weight.sqrt() / loss,
            Space::Raw => weight.sqrt(),
        };
        let scale: Vec<f64> = data.weights.iter().zip(&data.losses).map(scale).collect();
        let term = |(x, exponent): (&Vec<f64>, &f64)| {
            x.iter().zip(&scale).map(|(x, scale)| scale * (-exponent * x).exp()).collect()
        };
        let mut columns: Vec<Vec<f64>> = data.columns.x.iter().zip(exponents).map(term).collect();
        let y = data.losses.iter().zip(&scale).map(|(l, scale)| l * scale).collect();
        columns.push(scale);
        Self { columns, y }
    }

    /// c_1 … c_K and the constant as parameters, by least squares under the signs; none if no
    /// set of columns can be solved.
    fn solve(&self, constant: Constant) -> Option<Vector> {
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

    /// Logarithms; zero is replaced by a millionth of the mean loss.
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

/// The reduction of the sum of squares of y: 2 b·m − b'Gb.
fn gain(gram: &Matrix, moments: &Vector, values: &Vector, n: usize) -> f64 {
    let bent = times(gram, values, n);
    (0..n).map(|i| values[i] * (2.0 * moments[i] - bent[i])).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn descents_that_have_met_go_on_as_one() {
        let at = |x: f64| [x, 1.0, 2.0, 0.3, 0.4, 0.0, 0.0];
        let (kept, places) = distinct(&[at(1.0), at(1.0 + 1e-7), at(1.1), at(1.0)]);
        assert_eq!((kept, places), (vec![at(1.0), at(1.1)], vec![0, 0, 1, 0]));
    }
}
