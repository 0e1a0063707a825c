//! Resamples the rows of a parametric law for intervals (Efron 1979), and finds the rows with a large influence on a
//! predicted optimum.
//!
//! Each replicate draws as many rows as there are and descends from the optimum to its own. Rows of one configuration
//! are one cluster and are drawn together, with or without a column of seeds: they share the law's error there.
//!
//! Nothing depends on the number of threads. Tables of more than `MAX_CLUSTERS` clusters draw that
//! many and shrink the deviations by the root of the ratio (m out of n; Bickel et al. 1997).

use std::collections::HashMap;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_mt::Mt;
use rayon::prelude::*;

use super::form::{Coefficients, Vector};
use super::law::{Influence, optimum};
use super::objective::Curvature;
use super::search::Found;
use super::target::{End, Target};
use crate::laws::input::IsoFlopPoint;
use crate::laws::maths::solve;
use crate::laws::maths::stats::{below, interval95, standard_deviation};

/// Clusters above which a replicate draws fewer than there are.
const MAX_CLUSTERS: usize = 20_000;
/// Relative decrease of the objective that a fit to other rows does not go for.
const TOLERANCE: f64 = 1e-12;

/// The coefficients of every replicate.
#[derive(Clone, Debug)]
pub(super) struct Replicates {
    pub coefficients: Vec<Coefficients>,
    /// The number that ended at an optimum, as all should.
    pub converged: usize,
    pub asked: usize,
}

pub(super) fn bootstrap(
    points: &[IsoFlopPoint],
    target: &Target,
    found: &Found,
    (seed, asked): (u64, usize),
) -> Replicates {
    let clusters = clusters(points);
    let n = clusters.len();
    let draws = Draws::new(seed, asked, n.min(MAX_CLUSTERS), n);
    let replicate = |i: usize| {
        let mut times = vec![0; points.len()];
        let drawn = draws.of(i).into_iter().flat_map(|cluster| &clusters[cluster]);
        drawn.for_each(|row| times[*row] += 1);
        let data = target.data.repeated(&times);
        Target { data: &data, ..*target }.settle(&found.end.theta, &data.weights, TOLERANCE)
    };
    let ends: Vec<End> = (0..asked).into_par_iter().filter_map(replicate).collect();
    let shrink = (n.min(MAX_CLUSTERS) as f64 / n as f64).sqrt();
    let centre = found.end.theta;
    let coefficients = |end: &End| {
        let near = std::array::from_fn(|p| centre[p] + shrink * (end.theta[p] - centre[p]));
        target.coefficients(&near)
    };
    Replicates {
        coefficients: ends.iter().map(coefficients).collect(),
        converged: ends.iter().filter(|end| end.minimised.converged).count(),
        asked,
    }
}

/// Rows of one configuration, in the order of their first.
fn clusters(points: &[IsoFlopPoint]) -> Vec<Vec<usize>> {
    let mut places: HashMap<[u64; 4], usize> = HashMap::new();
    let mut clusters: Vec<Vec<usize>> = Vec::new();
    for (row, p) in points.iter().enumerate() {
        let key = [p.params_nonvocab, p.params_vocab, p.n_vocab, p.tokens].map(f64::to_bits);
        let place = *places.entry(key).or_insert(clusters.len());
        if place == clusters.len() {
            clusters.push(Vec::new());
        }
        clusters[place].push(row);
    }
    clusters
}

impl Replicates {
    fn each<T>(&self, of: impl Fn(&[f64]) -> Option<T>) -> Vec<T> {
        let n = self.coefficients.first().map_or(0, |c| c.values().len());
        let column = |i: usize| self.coefficients.iter().map(|c| c.values()[i]).collect::<Vec<_>>();
        (0..n).filter_map(|i| of(&column(i))).collect()
    }

    /// Standard deviations over the replicates, in the order of the form's names; empty if there
    /// are too few replicates.
    pub fn standard_errors(&self) -> Vec<f64> {
        self.each(|column| interval95(column).map(|_| standard_deviation(column)))
    }

    /// 95 % percentile intervals, likewise.
    pub fn intervals(&self) -> Vec<[f64; 2]> {
        self.each(|column| interval95(column))
    }
}

// The rows of a replicate are those of `numpy.random.choice(n, n)` after `numpy.random.seed(S)`, one replicate after the
// other, so that an analysis in Python can draw the same rows; with S = 42 they are those of Besiroglu et al. 2024. If
// they would fill much memory, each replicate has its own ChaCha8 stream instead.

/// Numbers that are kept at once, 4 bytes each.
const MOST_LISTED: usize = 20_000_000;

/// The draws of every replicate, made now or when they are asked for.
enum Draws {
    Listed { all: Vec<u32>, size: usize },
    Streams { seed: u64, size: usize, n: usize },
}

impl Draws {
    /// For each of `replicates` replicates, `size` numbers below `n`.
    fn new(seed: u64, replicates: usize, size: usize, n: usize) -> Self {
        if replicates * size > MOST_LISTED {
            return Self::Streams { seed, size, n };
        }
        let mut twister = Mt::new(seed as u32);
        let all = (0..replicates * size).map(|_| numpy_below(&mut twister, n as u32)).collect();
        Self::Listed { all, size }
    }

    /// The rows of one replicate.
    fn of(&self, replicate: usize) -> Vec<usize> {
        match self {
            Self::Listed { all, size } => {
                all[replicate * size..][..*size].iter().map(|row| *row as usize).collect()
            }
            Self::Streams { seed, size, n } => {
                let mut rng = ChaCha8Rng::seed_from_u64(*seed);
                rng.set_stream(replicate as u64);
                (0..*size).map(|_| below(&mut rng, *n)).collect()
            }
        }
    }
}

/// A number below `n` as numpy's legacy generator draws it, by masking and rejection.
fn numpy_below(twister: &mut Mt, n: u32) -> u32 {
    let mask = n.next_power_of_two().wrapping_sub(1);
    loop {
        let value = twister.next_u32() & mask;
        if value < n {
            return value;
        }
    }
}

// Influential rows.
//
// At an optimum the gradients g_i of all rows cancel. Without row i one Newton step leads to the new
// optimum: (H − H_i) s = g_i (Cook and Weisberg 1982). Among the rows that move N furthest by that step, the row
// whose removal moves it furthest after a refit is left out; this is repeated five times, upwards and downwards.

/// Rows that are named, at most.
const MOST_NAMED: usize = 5;
/// Rows that are tried by a refit, among those that move N furthest by one step.
const TRIED: usize = 8;
/// A factor of N that is not worth a warning.
const LITTLE: f64 = 1.2;
/// Rows of a table in which single ones no longer count.
const MOST_ROWS: usize = 20_000;

/// The rows that together move the optimal N at `budget` by more than [`LITTLE`]; `None` if there are none, or an
/// exponent is at its bound.
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

/// The shift of ln N without each of the rows kept, by one step from `theta`.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::parametric::form::{Form, Space};
    use crate::laws::parametric::target::Data;
    use crate::laws::parametric::tests::{chinchilla, chinchilla_runs};

    #[test]
    fn a_row_drawn_twice_counts_as_two_rows() {
        let data = Data::new(&chinchilla_runs(5, 0.01, 0), Form::Approach3, Space::Log).unwrap();
        let (drawn, mut times) = ([7, 7, 3, 30, 3, 7, 12, 21], vec![0; data.losses.len()]);
        drawn.iter().for_each(|row| times[*row] += 1);
        let value = |data: &Data| {
            let (form, space, tied) = (Form::Approach3, Space::Log, false);
            let target = Target { data, form, space, delta: 0.01, tied, bounds: [0.02, 3.0] };
            let theta = chinchilla().centred(data.constant, &data.means);
            let how = (target.delta, Curvature::Exact);
            let problem = target.problem(how, form.slots(tied), theta, &data.weights);
            problem.evaluate(&problem.free(&theta)).value
        };
        let (copied, counted) = (value(&data.rows(&drawn)), value(&data.repeated(&times)));
        assert!(copied > 0.0 && (copied / counted - 1.0).abs() < 1e-12, "{copied} {counted}");
    }

    /// `np.random.seed(42); np.random.choice(240, 240)`, 4000 times, by numpy 2.
    #[test]
    fn numpys_draws_are_numpys() {
        let draws = Draws::new(42, 4000, 240, 240);
        assert_eq!(draws.of(0)[..12], [102, 179, 92, 14, 106, 71, 188, 20, 102, 121, 210, 214]);
        assert_eq!(draws.of(3999)[235..], [183, 49, 20, 142, 164]);
    }

    #[test]
    fn draws_too_many_to_keep_are_made_when_asked_for() {
        let draws = Draws::new(1, 1001, 20_000, 50_000);
        assert!(matches!(draws, Draws::Streams { .. }));
        assert_eq!(draws.of(3), draws.of(3));
        assert_ne!(draws.of(3), draws.of(4));
        assert!(draws.of(3).len() == 20_000 && draws.of(3).iter().all(|row| *row < 50_000));
    }
}
