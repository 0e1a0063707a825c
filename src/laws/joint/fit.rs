//! Cells into the coefficients of a joint loss.

use super::levenberg::{Residuals, minimise};
use super::loss::{ALPHA, BETA, JointLoss, Place, Terms};
use super::{Cost, JointLaw};
use crate::laws::RunNoise;
use crate::laws::cell::Cell;
use crate::laws::least_squares::least_squares;
use crate::laws::minima::Grid;
use crate::laws::stats::distinct;

/// Cells beyond the coefficients, at least.
const SPARE: usize = 4;
/// Vocabularies that the terms of coupling need.
const COUPLED_LEVELS: usize = 4;
/// Passes over the data from which repetition has a term.
const REPEATED: f64 = 1.5;
/// The exponents that a search starts from.
const STARTS: [f64; 3] = [0.2, 0.5, 1.0];
/// Noise that the expectations are weighed with where it is not known, in nats.
pub(in crate::laws) const UNKNOWN_NOISE: f64 = 0.02;
/// The standard deviation of a coefficient of which nothing is expected.
const UNEXPECTED: f64 = 10.0;
/// Bounds of the exponents α and β.
const EXPONENTS: [f64; 2] = [0.02, 4.0];
/// Passes over the data that are worth the first one, R: what is expected, ln 15 (Muennighoff et al.
/// 2023), and its bounds.
const LN_R: [f64; 3] = [2.7, -2.0, 8.0];

/// The joint law through the cells of some budgets; none where they do not tell its coefficients.
///
/// Least squares over the cells by the runs that each is worth. Where the cells say little of a
/// coefficient it stays near what is expected of it: exponents near 0.4 within a factor of two, no
/// coupling. The expectations weigh as much as one run each, of standard deviation `noise`.
pub fn fit_joint(grids: &[Grid], noise: Option<RunNoise>, repeats: bool) -> Option<JointLaw> {
    let cells = Cells::new(grids);
    let terms = cells.terms(repeats)?;
    let problem = Problem::new(&cells, terms, noise);
    let ends = problem.starts().into_iter().map(|start| minimise(&problem, start));
    let (values, _) = ends.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let rss: f64 = problem.of_cells(&values).iter().map(|r| r * r).sum();
    let (n, p) = (cells.all.len(), terms.count());
    let free = problem.free(p);
    let finite = rss.is_finite() && values.iter().all(|value| value.is_finite());
    finite.then_some(())?;
    Some(JointLaw {
        cost: Cost::of(&cells.all)?,
        residual_sd: (rss / n as f64 / free).sqrt(),
        dof: (free * problem.effective_cells()).max(FEWEST_FREE) as usize,
        loss: problem.law(&values),
        bootstrap: Vec::new(),
        n,
    })
}

/// The coefficients through other losses of the same cells, downhill from those of `law`.
pub fn refitted(law: &JointLaw, grids: &[Grid], noise: Option<RunNoise>) -> Vec<f64> {
    let cells = Cells::new(grids);
    let mut problem = Problem::new(&cells, law.loss.terms, noise);
    problem.frame = law.loss.clone();
    minimise(&problem, law.loss.values.clone()).0
}

/// How far above its budget's best a cell counts a half, in units of the noise of a run.
const VALLEY: f64 = 5.0;

/// How much a cell counts that lies `above` the best of its budget: no smooth form holds everywhere,
/// and a law is asked of the valley.
pub(in crate::laws) fn valley(above: f64, noise: f64) -> f64 {
    1.0 / (1.0 + (above / (VALLEY * noise)).powi(2))
}

/// Degrees of freedom that the residuals are given, at least.
const FEWEST_FREE: f64 = 4.0;

/// The cells of all budgets.
struct Cells<'a> {
    all: Vec<&'a Cell>,
    /// How far each lies above the best of its budget, in nats.
    above: Vec<f64>,
}

impl<'a> Cells<'a> {
    fn new(grids: &'a [Grid]) -> Self {
        let above =
            |grid: &'a Grid| grid.cells.iter().map(move |cell| cell.loss - grid.best().loss);
        Self {
            all: grids.iter().flat_map(|grid| &grid.cells).collect(),
            above: grids.iter().flat_map(above).collect(),
        }
    }

    /// The terms that the cells can tell; none where even the fewest are too many, and where a term of
    /// repetition is asked for that no cell knows.
    fn terms(&self, repeats: bool) -> Option<Terms> {
        let levels = distinct(self.all.iter().map(|cell| cell.n_vocab)).len();
        let epochs = self.all.iter().filter_map(|cell| cell.epochs());
        if repeats && epochs.fold(0.0, f64::max) <= REPEATED {
            return None;
        }
        let wanted = [levels >= COUPLED_LEVELS, false].map(|coupled| Terms {
            vocab: levels > 1,
            coupled,
            repeats,
        });
        wanted.into_iter().find(|terms| self.all.len() >= terms.count() + SPARE)
    }

    /// The root of what each cell counts, one cell on average.
    fn weights(&self, noise: f64) -> Vec<f64> {
        let pairs = self.all.iter().zip(&self.above);
        let counts: Vec<f64> =
            pairs.map(|(cell, above)| cell.runs * valley(*above, noise)).collect();
        let mean = counts.iter().sum::<f64>() / counts.len() as f64;
        counts.iter().map(|count| (count / mean).sqrt()).collect()
    }

    fn centre(&self) -> [f64; 3] {
        let mean = |of: &dyn Fn(&Cell) -> f64| {
            self.all.iter().map(|cell| of(cell)).sum::<f64>() / self.all.len() as f64
        };
        let of = |cell: &Cell| place(cell);
        [mean(&|c| of(c).ln_size), mean(&|c| of(c).ln_vocab), mean(&|c| of(c).ln_tokens)]
    }
}

pub(super) fn place(cell: &Cell) -> Place {
    Place::new([cell.params_nonvocab, cell.n_vocab, cell.tokens], cell.unique_tokens)
}

/// Where a coefficient, or its logarithm, is expected to lie.
#[derive(Clone, Copy)]
struct Expectation {
    /// Among the values of a [`JointLoss`].
    index: usize,
    mean: f64,
    sd: f64,
    in_logs: bool,
}

/// What is expected of coefficients before the cells are asked.
fn expected(terms: Terms) -> Vec<Expectation> {
    let exponent = |index| Expectation { index, mean: 0.4f64.ln(), sd: 0.7, in_logs: true };
    let mut all = [ALPHA, BETA].map(exponent).to_vec();
    if terms.coupled {
        let first = terms.first_coupled();
        let near_zero = |(i, sd)| Expectation { index: first + i, mean: 0.0, sd, in_logs: false };
        all.extend([(0, 0.1), (1, 0.4), (2, 0.4)].map(near_zero));
    }
    if terms.repeats {
        let index = terms.count() - 1;
        all.push(Expectation { index, mean: LN_R[0], sd: 1.0, in_logs: false });
    }
    all
}

/// How widely each coefficient of a law may lie before any cell is asked, as standard deviations.
pub(in crate::laws) fn expected_sds(law: &JointLoss) -> Vec<f64> {
    let mut sds = vec![UNEXPECTED; law.terms.count()];
    for Expectation { index, sd, in_logs, .. } in expected(law.terms) {
        sds[index] = sd * if in_logs { law.values[index] } else { 1.0 };
    }
    sds
}

/// The residuals of every cell, and of every coefficient from what is expected of it.
struct Problem {
    /// Terms, centre and unique tokens, with coefficients that mean nothing.
    frame: JointLoss,
    places: Vec<Place>,
    losses: Vec<f64>,
    weights: Vec<f64>,
    noise: f64,
}

impl Problem {
    fn new(cells: &Cells, terms: Terms, noise: Option<RunNoise>) -> Self {
        let noise = noise.map(|noise| noise.sd).filter(|sd| *sd > 0.0).unwrap_or(UNKNOWN_NOISE);
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
            places: all.iter().map(|cell| place(cell)).collect(),
            losses: all.iter().map(|cell| cell.loss).collect(),
            weights: cells.weights(noise),
            noise: noise / runs.sqrt(),
        }
    }

    /// How many cells of equal weight these are worth, (Σw)²/Σw².
    fn effective_cells(&self) -> f64 {
        let squares: f64 = self.weights.iter().map(|weight| weight.powi(4)).sum();
        self.weights.iter().map(|weight| weight.powi(2)).sum::<f64>().powi(2) / squares
    }

    /// The share of the residuals' variance that a fit of `p` coefficients leaves.
    fn free(&self, p: usize) -> f64 {
        (1.0 - p as f64 / self.effective_cells()).max(0.2)
    }

    fn law(&self, values: &[f64]) -> JointLoss {
        JointLoss { values: values.to_vec(), ..self.frame.clone() }
    }

    fn of_cells(&self, values: &[f64]) -> Vec<f64> {
        let law = self.law(values);
        let rows = self.places.iter().zip(&self.losses).zip(&self.weights);
        rows.map(|((place, loss), weight)| weight * (loss - law.value(place))).collect()
    }

    /// The linear coefficients at each pair of exponents to start from.
    fn starts(&self) -> Vec<Vec<f64>> {
        let pairs = STARTS.iter().flat_map(|alpha| STARTS.map(|beta| (*alpha, beta)));
        pairs.filter_map(|(alpha, beta)| self.start(alpha, beta)).collect()
    }

    fn start(&self, alpha: f64, beta: f64) -> Option<Vec<f64>> {
        let Terms { vocab, coupled, repeats } = self.frame.terms;
        let [n0, v0, d0] = self.frame.centre;
        let row = |place: &Place| {
            let v = place.ln_vocab - v0;
            let mut row = vec![1.0, (-alpha * (place.ln_size - n0)).exp()];
            row.push((-beta * (place.ln_tokens - d0)).exp());
            row.extend([-v].into_iter().filter(|_| vocab));
            row.extend([v * v].into_iter().filter(|_| coupled));
            row
        };
        let rows: Vec<Vec<f64>> = self.places.iter().map(row).collect();
        let c = least_squares(&rows, &self.losses)?.coefficients;
        let positive = |x: f64| x.max(0.02).ln();
        let mut values = vec![c[0], positive(c[1]), alpha, positive(c[2]), beta];
        values.extend(c.get(3));
        values.extend(c.get(4));
        values.extend([0.0, 0.0].into_iter().filter(|_| coupled));
        values.extend([LN_R[0]].into_iter().filter(|_| repeats));
        Some(values)
    }
}

impl Residuals for Problem {
    fn at(&self, values: &[f64]) -> Vec<f64> {
        let expectation = |&Expectation { index, mean, sd, in_logs }: &Expectation| {
            let value = if in_logs { values[index].ln() } else { values[index] };
            self.noise * (mean - value) / sd
        };
        let mut all = self.of_cells(values);
        all.extend(expected(self.frame.terms).iter().map(expectation));
        all
    }

    fn slopes(&self, values: &[f64]) -> Vec<Vec<f64>> {
        let law = self.law(values);
        let of_cell = |(place, weight): (&Place, &f64)| {
            law.gradient(place).into_iter().map(|slope| weight * slope).collect()
        };
        let mut rows: Vec<Vec<f64>> = self.places.iter().zip(&self.weights).map(of_cell).collect();
        for Expectation { index, sd, in_logs, .. } in expected(self.frame.terms) {
            let mut row = vec![0.0; values.len()];
            row[index] = self.noise / sd / if in_logs { values[index] } else { 1.0 };
            rows.push(row);
        }
        rows
    }

    fn bound(&self, values: &mut [f64]) {
        let [low, high] = EXPONENTS;
        for index in [ALPHA, BETA] {
            values[index] = values[index].clamp(low, high);
        }
        if self.frame.terms.repeats {
            let last = values.len() - 1;
            values[last] = values[last].clamp(LN_R[1], LN_R[2]);
        }
    }
}
