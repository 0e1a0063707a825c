//! Where the optimum of a parametric law is looked for.
//!
//! By default by variable projection: over a grid of exponents the inner problem is solved exactly
//! (see [`inner`](super::inner)) and improved under the objective itself; the lowest grid points
//! are the starts of the full search. `Starts::Grid` takes instead the 4500 starts of Hoffmann et
//! al. 2022 (approach 3), as Besiroglu et al. 2024 list them.

use super::data::Data;
use super::form::{Coefficients, Form};
use super::inner::Basis;
use super::newton::{EXACT, Minimised, minimise};
use super::objective::{Curvature, Objective, Space};
use super::problem::{Problem, Slots};
use super::vector::Vector;
use rayon::prelude::*;

/// Where a search begins.
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

/// Share of a loss, or of its logarithm, that counts as rounding.
const ROUNDING: f64 = 1e-9;

/// What is minimised.
#[derive(Clone, Copy, Debug)]
pub(super) struct Target<'a> {
    pub data: &'a Data,
    pub form: Form,
    pub space: Space,
    pub delta: f64,
    /// Whether the first exponent equals the last.
    pub tied: bool,
    /// Least and largest exponent.
    pub bounds: [f64; 2],
}

/// Where a descent ended.
#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    /// All parameters, centred.
    pub theta: Vector,
    pub minimised: Minimised,
}

/// The best point found, and how the starts fared.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub end: End,
    pub starts: usize,
    pub starts_at_optimum: usize,
}

impl<'a> Target<'a> {
    /// The coefficients in the units of the table's columns.
    pub fn coefficients(&self, theta: &Vector) -> Coefficients {
        Coefficients::from_centred(self.form, self.data.constant, theta, &self.data.means)
    }

    pub fn problem(
        &self,
        (delta, curvature): (f64, Curvature),
        slots: Slots,
        base: Vector,
        weights: &'a [f64],
    ) -> Problem<'a> {
        let (columns, constant) = (&self.data.columns, self.data.constant);
        let objective =
            Objective { columns, weights, space: self.space, constant, delta, curvature };
        Problem::new(objective, slots, base)
    }

    /// Downhill from anywhere: least squares by Gauss and Newton, then Huber's function at ten
    /// times δ, then at δ. Each stage hands the next a start within its reach.
    fn descend(&self, start: &Vector) -> Option<End> {
        let (weights, slots) = (&self.data.weights, self.form.slots(self.tied));
        let stage = |how, start: &Vector, tolerance| {
            let problem = self.problem(how, slots, *start, weights);
            Some(problem.full(&minimise(problem, problem.free(start), tolerance)?.free))
        };
        let at = stage((f64::INFINITY, Curvature::GaussNewton), start, 1e-12)?;
        let at = stage((10.0 * self.delta, Curvature::Exact), &at, 1e-6)?;
        self.settle(&at, weights, 1e-12)
    }

    /// Downhill from near an optimum. An exponent that leaves its bounds is set to the nearer one
    /// and stays there while the others go on.
    pub fn settle(&self, start: &Vector, weights: &[f64], tolerance: f64) -> Option<End> {
        let (k, [least, most]) = (self.form.n_terms(), self.bounds);
        let mut slots = self.form.slots(self.tied);
        let mut theta = *start;
        loop {
            let target = Target { data: self.data, ..*self };
            let problem = target.problem((self.delta, Curvature::Exact), slots, theta, weights);
            let minimised = minimise(problem, problem.free(&theta), tolerance)?;
            theta = problem.full(&minimised.free);
            let outside = |p: &usize| slots[*p].is_some() && !(least..=most).contains(&theta[*p]);
            let Some(stray) = (k + 1..=2 * k).find(outside) else {
                return Some(End { theta, minimised });
            };
            let slot = slots[stray];
            for p in (k + 1..=2 * k).filter(|p| slots[*p] == slot) {
                theta[p] = theta[p].clamp(least, most);
            }
            slots = slots.map(|s| if s == slot { None } else { s });
        }
    }
}

/// The optimum; none where no start leads to one.
///
/// The starts of a large table go down on some of its rows, and only where the best of them ended
/// is the whole table's optimum looked for: the shares of starts are then those of the thinned rows.
pub(super) fn search(target: &Target, starts: Starts) -> Option<Found> {
    let thinned = thinned(target.data);
    let few = Target { data: &thinned, ..*target };
    let starts = match starts {
        Starts::Projected => projected(&few),
        Starts::Grid => hoffmann(&few),
    };
    let ends: Vec<End> = starts.par_iter().filter_map(|start| few.descend(start)).collect();
    let best = ends.iter().min_by(|a, b| a.minimised.value.total_cmp(&b.minimised.value))?;
    let lowest = few.settle(&best.theta, &thinned.weights, EXACT)?;
    let most = lowest.minimised.value * (1.0 + SAME) + rounding(&few);
    Some(Found {
        end: target.settle(&lowest.theta, &target.data.weights, EXACT)?,
        starts: starts.len(),
        starts_at_optimum: ends.iter().filter(|end| end.minimised.value <= most).count(),
    })
}

/// The objective of residuals that are rounding: where a law goes through all rows, every start ends below it, each
/// on other digits.
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

/// Hoffmann's 4500 starts; the vocabulary's term, where there is one, starts like the model's.
fn hoffmann(target: &Target) -> Vec<Vector> {
    let levels = |n: usize, from: f64, step: f64| (0..n).map(move |i| from + step * i as f64);
    let mut starts = Vec::with_capacity(4500);
    for ln_a in levels(6, 0.0, 5.0) {
        for ln_b in levels(6, 0.0, 5.0) {
            for ln_e in levels(5, -1.0, 0.5) {
                for alpha in levels(5, 0.0, 0.5) {
                    for beta in levels(5, 0.0, 0.5) {
                        starts.push(start(target, [ln_a, ln_b, ln_e, alpha, beta]));
                    }
                }
            }
        }
    }
    starts
}

fn start(target: &Target, [ln_a, ln_b, ln_e, alpha, beta]: [f64; 5]) -> Vector {
    let (a, b, e) = (ln_a.exp(), ln_b.exp(), ln_e.exp());
    let values = target.form.start([a, b, e, alpha, beta]);
    let coefficients = Coefficients::new(target.form, &values).expect("as many values as names");
    coefficients.centred(target.data.constant, &target.data.means)
}
