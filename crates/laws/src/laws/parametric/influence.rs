//! The rows that a predicted optimum hangs on.
//!
//! At an optimum the gradients g_i of all rows cancel. Without row i one Newton step leads to the new
//! optimum: (H − H_i) s = g_i (Cook and Weisberg 1982). The rows that move N furthest one way are then
//! left out together, and the law is fitted to the rest.

use serde::{Deserialize, Serialize};

use super::form::Coefficients;
use super::objective::Curvature;
use super::optimum::optimum;
use super::search::{Found, Target};
use super::vector::Vector;
use crate::laws::IsoFlopPoint;
use crate::laws::cholesky::solve;
use crate::laws::text::{count, times};

/// Rows that are named, at most.
const MOST_NAMED: usize = 5;
/// A row that moves N by less than this share of what the first one does is not named.
const WORTH_NAMING: f64 = 0.1;
/// A factor of N that is not worth a warning.
const LITTLE: f64 = 1.2;
/// Rows of a table in which single ones no longer count.
const MOST_ROWS: usize = 20_000;
/// Relative decrease of the objective that the fit without the rows does not go for.
const TOLERANCE: f64 = 1e-12;

/// A few rows that move a predicted optimum together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Influence {
    pub budget_flops: f64,
    /// Their names, the one that moves it most first.
    pub rows: Vec<String>,
    /// The optimal N (N_nv with a vocabulary) by all rows.
    pub params: f64,
    /// The same by the other rows alone.
    pub params_without: f64,
}

/// The rows that together move the optimal N at `budget` by more than [`LITTLE`]; `None` if there are
/// none, or an exponent is held at its bound.
pub(super) fn influence(
    points: &[IsoFlopPoint],
    target: &Target,
    found: &Found,
    budget: f64,
) -> Option<Influence> {
    if points.len() > MOST_ROWS {
        return None;
    }
    let size = |theta: &Vector| {
        let Target { form, data, .. } = *target;
        let law = Coefficients::from_centred(form, data.constant, theta, &data.means);
        Some(optimum(&law, budget)?.params_nonvocab.ln())
    };
    let own = size(&found.end.theta)?;
    let moved = moves(target, found, &|theta| Some(size(theta)? - own))?;
    let rows = furthest(&moved);
    let kept: Vec<usize> = (0..points.len()).filter(|row| !rows.contains(row)).collect();
    let rest = target.data.rows(&kept);
    let end =
        Target { data: &rest, ..*target }.settle(&found.end.theta, &rest.weights, TOLERANCE)?;
    let without = size(&end.theta)?;
    ((without - own).abs() > LITTLE.ln()).then(|| Influence {
        budget_flops: budget,
        rows: rows.iter().map(|row| points[*row].run_id.clone()).collect(),
        params: own.exp(),
        params_without: without.exp(),
    })
}

/// How far ln N moves without each row, by one step.
fn moves(
    target: &Target,
    found: &Found,
    change: &dyn Fn(&Vector) -> Option<f64>,
) -> Option<Vec<f64>> {
    let slots = target.form.slots(target.tied);
    let theta = found.end.theta;
    let how = (target.delta, Curvature::Exact);
    let whole = target.problem(how, slots, theta, &target.data.weights);
    let (n, free) = (whole.n_free, whole.free(&theta));
    let all = whole.evaluate(&free);
    let step = |row: usize| {
        let data = target.data.rows(&[row]);
        let alone = Target { data: &data, ..*target };
        let own = alone.problem(how, slots, theta, &data.weights).evaluate(&free);
        let rest =
            std::array::from_fn(|p| std::array::from_fn(|q| all.hessian[p][q] - own.hessian[p][q]));
        let step = solve(&rest, 0.0, &own.gradient, n)
            .or_else(|| solve(&all.hessian, 0.0, &own.gradient, n))?;
        change(&whole.full(&std::array::from_fn(|p| free[p] + step[p])))
    };
    let bounded = (0..target.form.n_terms())
        .any(|term| target.bounds.contains(&theta[target.form.n_terms() + 1 + term]));
    (!bounded).then(|| (0..target.data.columns.n).map(|row| step(row).unwrap_or(0.0)).collect())
}

/// The rows that move it furthest the one way or the other, whichever way leads further.
fn furthest(moved: &[f64]) -> Vec<usize> {
    let way = |sign: f64| {
        let mut rows: Vec<usize> =
            (0..moved.len()).filter(|row| sign * moved[*row] > 0.0).collect();
        rows.sort_by(|a, b| moved[*b].abs().total_cmp(&moved[*a].abs()));
        rows.truncate(MOST_NAMED);
        let most = rows.first().map_or(0.0, |row| moved[*row].abs());
        rows.retain(|row| moved[*row].abs() >= WORTH_NAMING * most);
        rows
    };
    let sum = |rows: &[usize]| rows.iter().map(|row| moved[*row].abs()).sum::<f64>();
    let (up, down) = (way(1.0), way(-1.0));
    if sum(&up) > sum(&down) { up } else { down }
}

impl Influence {
    /// What hangs on which rows, in a sentence.
    pub(super) fn sentence(&self, size: &str) -> String {
        let Self { budget_flops, rows, params, params_without } = self;
        let factor = (params / params_without).max(params_without / params);
        format!(
            "{} row(s) move the optimal {size} at {} FLOPs by a factor {}: without {} it is {}, with \
             them {}. Look at them, or leave them out by --where or --drop-highest.",
            rows.len(),
            count(*budget_flops),
            times(factor),
            rows.join(", "),
            count(*params_without),
            count(*params)
        )
    }
}
