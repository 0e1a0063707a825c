//! One smooth loss over all budgets: L(N, V, D), fitted to every cell of a sweep.
//!
//! L = e0 − e1 (1 − V^−κe)/κe + A V^κa N^−α + B V^κb N^χ D^−β, N = N_nv, and V from the middle one.
//!
//! Why these terms. A code out of V carries more information, so for large model and data the normalised loss falls
//! with ln V (e1), less and less (κe): it cannot fall below minus the information that past and caption have about the
//! next frames. The distance from this limit has a model part and a data part, as in Hoffmann et al. 2022; both
//! grow with V, as more codes must be distinguished (κ). A larger model takes smaller steps, so a token is worth
//! less to it (χ above 0). With one vocabulary χ is left out, which gives Hoffmann's law.
//!
//! If runs repeat their data, D is replaced by the worth of D tokens of which U are distinct (Muennighoff et al.
//! 2023): U(1 + R(1 − e^(−(D/U − 1)/R))). R falls as N^−ρ, since a larger model may memorise its data sooner.

mod law;
mod loss;
#[cfg(test)]
mod tests;

pub use law::{JointLaw, Off, SizedLoss};
pub use loss::{JointLoss, Repetition, Terms};
pub(super) use loss::{Place, repeat};

use self::law::Cost;
use self::loss::{ALPHA, BETA, Cells, told};
use crate::laws::input::Cell;
use crate::laws::maths::engine::{MOST, MOST_STEPS, Residuals, Row, minimise};
use crate::laws::maths::least_squares;
use crate::laws::maths::stats::Normals;
use crate::laws::minima::{Grid, RunNoise, loss_unit};
use crate::laws::noise::Scatter;
use rayon::prelude::*;

/// Degrees of freedom that the residuals are given, at least.
const FEWEST_FREE: f64 = 4.0;

/// Fits the joint law to the cells of some budgets; `None` if they do not determine its coefficients.
///
/// Least squares over the cells, weighted by their effective runs. A coefficient that the cells hardly determine
/// stays near its prior: exponents near 0.4 within a factor of two, no coupling. Each prior has the weight of one
/// run, of standard deviation `noise`.
pub(super) fn fit_joint(
    grids: &[Grid],
    noise: Option<RunNoise>,
    repeats: bool,
) -> Option<JointLaw> {
    let cells = Cells::new(grids);
    let terms = cells.terms(repeats)?;
    let problem =
        Problem::new(&cells, terms, RunNoise::sd_or_guess(noise, grids), loss_unit(grids));
    let values = problem.best()?;
    let rss = problem.of_cells(&values);
    let (n, p) = (cells.all.len(), terms.count());
    let free = problem.free(p);
    let finite = rss.is_finite() && values.iter().all(|value| value.is_finite());
    finite.then_some(())?;
    Some(JointLaw {
        cost: Cost::of(&cells.all)?,
        residual_sd: (rss / n as f64 / free).sqrt(),
        dof: (free * problem.effective_cells()).max(FEWEST_FREE) as usize,
        loss: problem.frame.with(&values),
        bootstrap: Vec::new(),
        n,
    })
}

// Replicates.
//
// A replicate perturbs every cell around the law by the standard deviation of the residuals (run noise and misfit), all
// cells of a vocabulary together by tokenizer noise, and cells by the slopes of another test split; then it refits
// the law.

/// Separates the random streams of these replicates from those of minima.
const STREAMS: u64 = 1 << 40;

/// Residuals are taken for misfit up to so many times the scatter.
const MOST_MISFIT: f64 = 2.0;

/// The coefficients of `count` replicates of `law`, which was fitted to `grids`, drawn from a seed.
pub(super) fn replicates(
    law: &JointLaw,
    grids: &[Grid],
    (scatter, seed): (Scatter, u64),
    count: usize,
) -> Vec<Vec<f64>> {
    let normals = |i| Normals::of_stream(seed, STREAMS + i);
    let streams = (0..count as u64).into_par_iter().map(normals);
    streams.map(|normals| replicate(law, grids, scatter, normals)).collect()
}

/// The ratio of the residuals to run and tokenizer noise; at least 1. The misfit of a form is similar in neighbouring
/// cells, so it moves a law further than noise of the same size.
fn misfit(law: &JointLaw, grids: &[Grid], Scatter { noise, tokenizers, .. }: Scatter) -> f64 {
    let Some(noise) = noise else { return 1.0 };
    let cells = grids.iter().flat_map(Grid::of_all_shares).flatten();
    let of_cell = |cell: &Cell| {
        let tokenizer = tokenizers.map_or(0.0, |noise| noise.of_mean(cell.n_vocab));
        noise.sd.powi(2) / cell.runs + tokenizer.powi(2)
    };
    let variance = cells.map(of_cell).sum::<f64>() / law.n as f64;
    let ratio = law.residual_sd / variance.sqrt();
    if ratio.is_finite() { ratio.clamp(1.0, MOST_MISFIT) } else { 1.0 }
}

fn replicate(law: &JointLaw, grids: &[Grid], scatter: Scatter, mut normals: Normals) -> Vec<f64> {
    let Scatter { noise, tokenizers, test } = scatter;
    let sd = law.residual_sd * (law.dof as f64 / normals.chi_square(law.dof)).sqrt();
    let sd = sd * misfit(law, grids, scatter);
    let shifts = tokenizers.map(|noise| noise.shifts(&mut normals)).unwrap_or_default();
    let clips = test.map(|noise| noise.draw(&mut normals));
    let cells = || grids.iter().flat_map(Grid::of_all_shares).flatten();
    let mean_runs = cells().map(|cell| cell.runs).sum::<f64>() / law.n as f64;
    let mut drawn = |cell: &Cell, best: &Cell| {
        let noise = sd * (mean_runs / cell.runs).sqrt() * normals.draw();
        let of_clips = clips.as_ref().map_or(0.0, |clips| clips.shift(cell, best));
        law.loss.value(&Place::of(cell)) + shifts.of(cell.n_vocab) + of_clips + noise
    };
    let replicate = |grid: &Grid| grid.with_losses(|cell| drawn(cell, grid.best()));
    let drawn: Vec<Grid> = grids.iter().map(replicate).collect();
    refitted(law, (grids, &drawn), noise)
}

/// The coefficients fitted to other losses of the same cells, starting from `law`.
///
/// Cells keep the weights of `grids`: with weights by the drawn losses, cells that are low by chance would count
/// more, and every replicate would lie below the law.
fn refitted(
    law: &JointLaw,
    (grids, drawn): (&[Grid], &[Grid]),
    noise: Option<RunNoise>,
) -> Vec<f64> {
    let cells = Cells::new(drawn);
    let noise = RunNoise::sd_or_guess(noise, grids);
    let mut problem = Problem::new(&cells, law.loss.terms, noise, loss_unit(grids));
    problem.weights = Cells::new(grids).weights(noise);
    problem.frame = law.loss.clone();
    minimise(&problem, law.loss.values.clone(), MOST_STEPS).0
}

// The residuals of cells and of priors.

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
pub(super) fn expected_sds(law: &JointLoss, unit: f64) -> Vec<f64> {
    let mut sds = vec![UNEXPECTED; law.terms.count()];
    law.terms.of_the_loss().for_each(|index| sds[index] *= unit);
    for Expectation { index, sd, in_logs, .. } in expected(law.terms) {
        sds[index] = sd * if in_logs { law.values[index] } else { 1.0 };
    }
    sds
}

/// The residuals of every cell, and of every coefficient from its prior.
struct Problem {
    /// Terms, centre and unique tokens, with coefficients that mean nothing.
    frame: JointLoss,
    places: Vec<Place>,
    losses: Vec<f64>,
    weights: Vec<f64>,
    expected: Vec<Expectation>,
    noise: f64,
    least: f64,
}

impl Problem {
    /// `noise` is the standard deviation of a run; `unit` of the loss is worth a nat.
    fn new(cells: &Cells, terms: Terms, noise: f64, unit: f64) -> Self {
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
    fn effective_cells(&self) -> f64 {
        let squares: f64 = self.weights.iter().map(|weight| weight.powi(4)).sum();
        self.weights.iter().map(|weight| weight.powi(2)).sum::<f64>().powi(2) / squares
    }

    /// The share of the residuals' variance that a fit of `p` coefficients leaves.
    fn free(&self, p: usize) -> f64 {
        (1.0 - p as f64 / self.effective_cells()).max(0.2)
    }

    /// The weighed sum of squares of the cells alone.
    fn of_cells(&self, values: &[f64]) -> f64 {
        let law = self.frame.with(values);
        let rows = self.places.iter().zip(&self.losses).zip(&self.weights);
        rows.map(|((place, loss), weight)| (weight * (loss - law.value(place))).powi(2)).sum()
    }

    /// The coefficients downhill from the most promising of some starts.
    fn best(&self) -> Option<Vec<f64>> {
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
