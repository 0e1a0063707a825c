//! The rows that a predicted optimum hangs on.
//!
//! At an optimum the gradients g_i of all rows cancel. Without row i one Newton step leads to the new
//! optimum: (H − H_i) s = g_i (Cook and Weisberg 1982). Of the rows that move N furthest by that step,
//! the one whose loss moves it furthest once the law is fitted to the rest is left out; so on, five
//! times, upwards and downwards.

use serde::{Deserialize, Serialize};

use super::objective::Curvature;
use super::optimum::optimum;
use super::search::{Found, Target};
use super::vector::Vector;
use crate::laws::input::point::IsoFlopPoint;
use crate::laws::maths::cholesky::solve;

/// Rows that are named, at most.
const MOST_NAMED: usize = 5;
/// Rows that are left out by way of trial, of those that one step says move N furthest.
const TRIED: usize = 8;
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
    let k = target.form.n_terms();
    let exponents = &found.end.theta[k + 1..=2 * k];
    if points.len() > MOST_ROWS || exponents.iter().any(|e| target.bounds.contains(e)) {
        return None;
    }
    let own = ln_size(target, &found.end.theta, budget)?;
    let ways = [1.0, -1.0].into_iter().filter_map(|sign| without(target, found, (budget, sign)));
    let furthest = |(size, _): &(f64, Vec<usize>)| (size - own).abs();
    let (size, rows) = ways.max_by(|a, b| furthest(a).total_cmp(&furthest(b)))?;
    ((size - own).abs() > LITTLE.ln()).then(|| Influence {
        budget_flops: budget,
        rows: rows.iter().map(|row| points[*row].run_id.clone()).collect(),
        params: own.exp(),
        params_without: size.exp(),
    })
}

/// ln of the optimal N.
fn ln_size(target: &Target, theta: &Vector, budget: f64) -> Option<f64> {
    Some(optimum(&target.coefficients(theta), budget)?.params_nonvocab.ln())
}

/// ln N without the rows that move it furthest up or down, by the sign, and those rows: one after the
/// other, each the best of a few that one step would move it furthest by.
fn without(
    target: &Target,
    found: &Found,
    (budget, sign): (f64, f64),
) -> Option<(f64, Vec<usize>)> {
    let mut kept: Vec<usize> = (0..target.data.columns.n).collect();
    let (mut theta, mut rows) = (found.end.theta, Vec::new());
    let mut size = ln_size(target, &theta, budget)?;
    while rows.len() < MOST_NAMED {
        let steps = moves(target, &theta, &kept, budget);
        let mut order: Vec<usize> = (0..kept.len()).collect();
        order.sort_by(|a, b| (sign * steps[*b]).total_cmp(&(sign * steps[*a])));
        let tried = order.into_iter().take(TRIED).filter_map(|place| {
            let rest: Vec<usize> = kept.iter().copied().filter(|row| *row != kept[place]).collect();
            let data = target.data.rows(&rest);
            let rest = Target { data: &data, ..*target };
            let end = rest.settle(&theta, &data.weights, TOLERANCE)?;
            Some((ln_size(&rest, &end.theta, budget)?, end.theta, place))
        });
        let best = tried.max_by(|a, b| (sign * a.0).total_cmp(&(sign * b.0)))?;
        if sign * (best.0 - size) <= 0.0 {
            break;
        }
        (size, theta) = (best.0, best.1);
        rows.push(kept.remove(best.2));
    }
    Some((size, rows))
}

/// How far ln N moves without each of the rows kept, by one step from `theta`.
fn moves(target: &Target, theta: &Vector, kept: &[usize], budget: f64) -> Vec<f64> {
    let slots = target.form.slots(target.tied);
    let how = (target.delta, Curvature::Exact);
    let data = target.data.rows(kept);
    let whole = Target { data: &data, ..*target };
    let problem = whole.problem(how, slots, *theta, &data.weights);
    let (n, free) = (problem.n_free, problem.free(theta));
    let all = problem.evaluate(&free);
    let here = ln_size(target, theta, budget);
    let step = |row: &usize| {
        let data = target.data.rows(&[*row]);
        let alone = Target { data: &data, ..*target };
        let own = alone.problem(how, slots, *theta, &data.weights).evaluate(&free);
        let rest =
            std::array::from_fn(|p| std::array::from_fn(|q| all.hessian[p][q] - own.hessian[p][q]));
        let step = solve(&rest, 0.0, &own.gradient, n)
            .or_else(|| solve(&all.hessian, 0.0, &own.gradient, n))?;
        let there = problem.full(&std::array::from_fn(|p| free[p] + step[p]));
        Some(ln_size(target, &there, budget)? - here?)
    };
    kept.iter().map(|row| step(row).unwrap_or(0.0)).collect()
}
