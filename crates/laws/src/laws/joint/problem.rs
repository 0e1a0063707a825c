//! The objective of a joint law: the cells, their weights, and their residuals.

use super::loss::{ALPHA, BETA, JointLoss, Place, Terms, told};
use crate::laws::input::{Cell, best_index};
use crate::laws::maths::engine::{MOST, MOST_STEPS, Residuals, Row, minimise};
use crate::laws::maths::least_squares;
use crate::laws::maths::stats::distinct;
use crate::laws::minima::{Grid, valley};

/// Cells beyond the coefficients, at least.
const SPARE: usize = 4;
/// Fewest sizes, and losses, that determine a term of the size.
const FEWEST_SIZES: usize = 3;
/// Vocabularies that κe, κa and κb need.
const SATURATING_LEVELS: usize = 4;
/// Passes over the data from which a run repeats it.
const REPEATED: f64 = 1.5;

/// Whether runs repeat their data, so that a joint law has a term of repetition.
pub(in crate::laws) fn repeat(grids: &[Grid]) -> bool {
    let cells = grids.iter().flat_map(Grid::of_all_shares).flatten();
    cells.filter_map(Cell::epochs).any(|epochs| epochs > REPEATED)
}

/// The cells of all budgets and shares.
pub(super) struct Cells<'a> {
    pub all: Vec<&'a Cell>,
    /// The loss of each above the best of its budget and share, in nats.
    above: Vec<f64>,
}

impl<'a> Cells<'a> {
    pub fn new(grids: &'a [Grid]) -> Self {
        let slices = || grids.iter().flat_map(Grid::of_all_shares);
        let above = |cells: &'a [Cell]| {
            let best = cells[best_index(cells)].loss;
            cells.iter().map(move |cell| cell.loss - best)
        };
        Self { all: slices().flatten().collect(), above: slices().flat_map(above).collect() }
    }

    /// The terms that the cells can determine; `None` if even the fewest are too many, or if a term of repetition is
    /// asked for and no cell has its distinct tokens.
    ///
    /// Cells that do not repeat their data leave R at its prior.
    pub fn terms(&self, repeats: bool) -> Option<Terms> {
        let levels = distinct(self.all.iter().map(|cell| cell.n_vocab)).len();
        let sizes = distinct(self.all.iter().map(|cell| cell.params_nonvocab)).len();
        let losses = distinct(self.all.iter().map(|cell| cell.loss)).len();
        if sizes < FEWEST_SIZES || losses < FEWEST_SIZES {
            return None;
        }
        if repeats && self.all.iter().all(|cell| cell.unique_tokens.is_none()) {
            return None;
        }
        let wanted = [levels >= SATURATING_LEVELS, false].map(|saturating| Terms {
            vocab: levels > 1,
            saturating,
            crossed: saturating,
            repeats,
        });
        wanted.into_iter().find(|terms| self.all.len() >= terms.count() + SPARE)
    }

    /// The square root of each cell's weight, one on average.
    pub fn weights(&self, noise: f64) -> Vec<f64> {
        let pairs = self.all.iter().zip(&self.above);
        let counts: Vec<f64> =
            pairs.map(|(cell, above)| cell.runs * valley(*above, noise)).collect();
        let mean = counts.iter().sum::<f64>() / counts.len() as f64;
        counts.iter().map(|count| (count / mean).sqrt()).collect()
    }

    fn centre(&self) -> [f64; 3] {
        let places: Vec<Place> = self.all.iter().map(|cell| Place::of(cell)).collect();
        let mean = |of: fn(&Place) -> f64| places.iter().map(of).sum::<f64>() / places.len() as f64;
        [mean(|place| place.ln_size), mean(|place| place.ln_vocab), mean(|place| place.ln_tokens)]
    }
}

// The residuals.

/// The exponents that a search starts from.
const STARTS: [f64; 3] = [0.2, 0.5, 1.0];
/// The standard deviation of a coefficient of which nothing is expected: one of the loss in what is worth a nat, or a
/// logarithm.
const UNEXPECTED: f64 = 10.0;
/// The least A and B that a search starts from, in what is worth a nat.
const LEAST: f64 = 0.02;
/// Bounds of the exponents α and β.
const EXPONENTS: [f64; 2] = [0.02, 4.0];
/// The rate at which the limit of the loss saturates in ln V: its prior, within a factor e, and its bounds.
const KAPPA_E: f64 = 0.1;
const KAPPAS_E: [f64; 2] = [0.002, 2.0];
/// ln R: its prior, ln 15 (Muennighoff et al. 2023), and its bounds.
const LN_R: [f64; 3] = [2.7, -2.0, 8.0];
/// Bounds of ρ, R ∝ N^−ρ: a larger model memorises its data sooner.
const RHO: f64 = 0.4;
/// Steps from each start, and the number of the lowest that are then followed to convergence.
const FIRST_STEPS: usize = 15;
const FOLLOWED: usize = 3;

/// The prior of a coefficient or its logarithm.
#[derive(Clone, Copy)]
struct Expectation {
    /// Among the values of a [`JointLoss`].
    index: usize,
    mean: f64,
    sd: f64,
    in_logs: bool,
}

/// The priors of all coefficients.
fn expected(terms: Terms) -> Vec<Expectation> {
    let exponent = |index| Expectation { index, mean: 0.4f64.ln(), sd: 0.7, in_logs: true };
    let mut all = [ALPHA, BETA].map(exponent).to_vec();
    if terms.saturating {
        let first = terms.kappa_e();
        let near_zero = |i| Expectation { index: first + i, mean: 0.0, sd: 0.4, in_logs: false };
        all.push(Expectation { index: first, mean: KAPPA_E.ln(), sd: 1.0, in_logs: true });
        all.extend([1, 2].map(near_zero));
    }
    if terms.crossed {
        all.push(Expectation { index: terms.chi(), mean: 0.0, sd: 0.3, in_logs: false });
    }
    if terms.repeats {
        let index = terms.ln_r();
        all.push(Expectation { index, mean: LN_R[0], sd: 1.0, in_logs: false });
        all.push(Expectation { index: index + 1, mean: 0.0, sd: RHO, in_logs: false });
    }
    all
}

/// How widely each coefficient of a law may lie before any cell is asked, as standard deviations; `unit` of the loss is
/// worth a nat.
pub(in crate::laws) fn expected_sds(law: &JointLoss, unit: f64) -> Vec<f64> {
    let mut sds = vec![UNEXPECTED; law.terms.count()];
    law.terms.of_the_loss().for_each(|index| sds[index] *= unit);
    for Expectation { index, sd, in_logs, .. } in expected(law.terms) {
        sds[index] = sd * if in_logs { law.values[index] } else { 1.0 };
    }
    sds
}

/// The residuals of every cell, and of every coefficient from its prior.
pub(super) struct Problem {
    /// Terms, centre and unique tokens, with coefficients that mean nothing.
    pub frame: JointLoss,
    places: Vec<Place>,
    losses: Vec<f64>,
    pub weights: Vec<f64>,
    expected: Vec<Expectation>,
    noise: f64,
    least: f64,
}

impl Problem {
    /// `noise` is the standard deviation of a run; `unit` of the loss is worth a nat.
    pub fn new(cells: &Cells, terms: Terms, noise: f64, unit: f64) -> Self {
        let all = &cells.all;
        let runs = all.iter().map(|cell| cell.runs).sum::<f64>() / all.len() as f64;
        let unique = all.iter().filter_map(|cell| cell.unique_tokens);
        let unique_tokens = unique.reduce(f64::max).filter(|_| terms.repeats);
        Self {
            frame: JointLoss {
                terms,
                centre: cells.centre(),
                values: vec![0.0; terms.count()],
                unique_tokens,
            },
            places: all.iter().map(|cell| Place::of(cell)).collect(),
            losses: all.iter().map(|cell| cell.loss).collect(),
            weights: cells.weights(noise),
            expected: expected(terms),
            noise: noise / runs.sqrt(),
            least: LEAST * unit,
        }
    }

    /// The effective number of cells, (Σw)²/Σw².
    pub fn effective_cells(&self) -> f64 {
        let squares: f64 = self.weights.iter().map(|weight| weight.powi(4)).sum();
        self.weights.iter().map(|weight| weight.powi(2)).sum::<f64>().powi(2) / squares
    }

    /// The share of the residuals' variance that a fit of `p` coefficients leaves.
    pub fn free(&self, p: usize) -> f64 {
        (1.0 - p as f64 / self.effective_cells()).max(0.2)
    }

    /// The weighed sum of squares of the cells alone.
    pub fn of_cells(&self, values: &[f64]) -> f64 {
        let law = self.frame.with(values);
        let rows = self.places.iter().zip(&self.losses).zip(&self.weights);
        rows.map(|((place, loss), weight)| (weight * (loss - law.value(place))).powi(2)).sum()
    }

    /// The coefficients downhill from the most promising of some starts.
    pub fn best(&self) -> Option<Vec<f64>> {
        let pairs = STARTS.iter().flat_map(|alpha| STARTS.map(|beta| (*alpha, beta)));
        let starts = pairs.filter_map(|(alpha, beta)| self.start(alpha, beta));
        let near = starts.map(|start| minimise(self, start, FIRST_STEPS));
        let mut near: Vec<(Vec<f64>, f64)> = near.collect();
        near.sort_by(|a, b| a.1.total_cmp(&b.1));
        let followed = near.into_iter().take(FOLLOWED);
        let ends = followed.map(|(values, _)| minimise(self, values, MOST_STEPS));
        ends.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(values, _)| values)
    }

    /// The residual of each coefficient from its prior, in units of the noise, with its derivative.
    fn of_expectations(&self, values: &[f64]) -> impl Iterator<Item = (f64, usize, f64)> {
        self.expected.iter().map(|&Expectation { index, mean, sd, in_logs }| {
            let (value, slope) = match in_logs {
                true => (values[index].ln(), 1.0 / values[index]),
                false => (values[index], 1.0),
            };
            (self.noise * (mean - value) / sd, index, self.noise * slope / sd)
        })
    }

    /// The linear coefficients at a pair of exponents to start from.
    fn start(&self, alpha: f64, beta: f64) -> Option<Vec<f64>> {
        let Terms { vocab, saturating, crossed, repeats } = self.frame.terms;
        let [n0, v0, d0] = self.frame.centre;
        let kappa_e = if saturating { KAPPA_E } else { 0.0 };
        let row = |place: &Place| {
            let v = place.ln_vocab - v0;
            let mut row = vec![1.0, (-alpha * (place.ln_size - n0)).exp()];
            row.push((-beta * (place.ln_tokens - d0)).exp());
            row.extend([-told(v, kappa_e)].into_iter().filter(|_| vocab));
            row
        };
        let rows: Vec<Vec<f64>> = self.places.iter().map(row).collect();
        let c = least_squares(&rows, &self.losses)?.coefficients;
        let positive = |x: f64| x.max(self.least).ln();
        let mut values = vec![c[0], positive(c[1]), alpha, positive(c[2]), beta];
        values.extend(c.get(3));
        values.extend([kappa_e, 0.0, 0.0].into_iter().filter(|_| saturating));
        values.extend([0.0].into_iter().filter(|_| crossed));
        values.extend([LN_R[0], 0.0].into_iter().filter(|_| repeats));
        Some(values)
    }
}

impl Residuals for Problem {
    fn sum(&self, values: &[f64]) -> f64 {
        let expectations = self.of_expectations(values).map(|(residual, ..)| residual.powi(2));
        self.of_cells(values) + expectations.sum::<f64>()
    }

    fn each(&self, values: &[f64], take: &mut dyn FnMut(f64, &Row)) {
        let law = self.frame.with(values);
        for ((place, loss), weight) in self.places.iter().zip(&self.losses).zip(&self.weights) {
            let (value, slopes) = law.with_slopes(place);
            take(weight * (loss - value), &slopes.map(|slope| weight * slope));
        }
        for (residual, index, slope) in self.of_expectations(values) {
            let mut row = [0.0; MOST];
            row[index] = slope;
            take(residual, &row);
        }
    }

    fn bound(&self, values: &mut [f64]) {
        let [low, high] = EXPONENTS;
        for index in [ALPHA, BETA] {
            values[index] = values[index].clamp(low, high);
        }
        if self.frame.terms.saturating {
            let [low, high] = KAPPAS_E;
            let kappa_e = &mut values[self.frame.terms.kappa_e()];
            *kappa_e = kappa_e.clamp(low, high);
        }
        if self.frame.terms.repeats {
            let ln_r = &mut values[self.frame.terms.ln_r()];
            *ln_r = ln_r.clamp(LN_R[1], LN_R[2]);
        }
    }
}
