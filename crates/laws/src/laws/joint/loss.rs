//! The loss as a function of N, V and D, and the cells that it is fitted to.

use serde::{Deserialize, Serialize};

use crate::laws::input::{Cell, best_index};
use crate::laws::maths::engine::{MOST, Row};
use crate::laws::maths::stats::distinct;
use crate::laws::minima::{Grid, valley};

/// The terms of a joint loss in addition to e0, A, α, B and β.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Terms {
    /// e1: several vocabularies were tried.
    pub vocab: bool,
    /// κe, κa and κb, with enough vocabularies: the saturation in V of the loss limit, and the growth of its two terms
    /// with V.
    pub saturating: bool,
    /// χ: a token is worth less, or more, to a larger model.
    #[serde(default)]
    pub crossed: bool,
    /// R and ρ: some runs repeat their data, which may be worth less to a larger model.
    pub repeats: bool,
}

/// The coefficients of a joint loss, around the middle of the cells they were fitted to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointLoss {
    pub terms: Terms,
    /// ln N, ln V and ln D at the middle of the cells.
    pub centre: [f64; 3],
    /// e0, ln A, α, ln B, β; then e1; then κe, κa, κb; then χ; then ln R and ρ: those that `terms`
    /// has.
    pub values: Vec<f64>,
    /// U, where data repeats.
    pub unique_tokens: Option<f64>,
}

/// The five coefficients that every joint loss has.
const BASE: usize = 5;
/// The indices of α and β among the values.
pub(super) const ALPHA: usize = 2;
pub(super) const BETA: usize = 4;

impl Terms {
    /// Coefficients.
    pub fn count(self) -> usize {
        self.ln_r() + 2 * usize::from(self.repeats)
    }

    /// The names of the coefficients, in their order.
    pub fn names(self) -> Vec<&'static str> {
        let own = ["e0", "ln A", "alpha", "ln B", "beta"].into_iter();
        let vocab = ["e1"].into_iter().filter(move |_| self.vocab);
        let kappas = ["kappa_e", "kappa_a", "kappa_b"].into_iter();
        own.chain(vocab)
            .chain(kappas.filter(move |_| self.saturating))
            .chain(["chi"].into_iter().filter(|_| self.crossed))
            .chain(["ln R", "rho"].into_iter().filter(|_| self.repeats))
            .collect()
    }

    /// Where the coefficients stand that are a loss: e0 and e1.
    pub(super) fn of_the_loss(self) -> impl Iterator<Item = usize> {
        [0].into_iter().chain(self.vocab.then_some(BASE))
    }

    /// Where κe stands among the values.
    pub(super) fn kappa_e(self) -> usize {
        BASE + usize::from(self.vocab)
    }

    /// The index of χ among the values.
    pub(super) fn chi(self) -> usize {
        self.kappa_e() + 3 * usize::from(self.saturating)
    }

    /// The index of ln R among the values; ρ follows.
    pub(super) fn ln_r(self) -> usize {
        self.chi() + usize::from(self.crossed)
    }
}

/// A place at which to evaluate the loss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::laws) struct Place {
    pub ln_size: f64,
    pub ln_vocab: f64,
    pub ln_tokens: f64,
    /// U of the runs there.
    pub unique_tokens: Option<f64>,
}

impl Place {
    /// From N_nv, V (0 if unknown) and D, with `unique_tokens` distinct tokens.
    pub fn new([size, n_vocab, tokens]: [f64; 3], unique_tokens: Option<f64>) -> Self {
        let ln_vocab = if n_vocab > 0.0 { n_vocab.ln() } else { 0.0 };
        Self { ln_size: size.ln(), ln_vocab, ln_tokens: tokens.ln(), unique_tokens }
    }

    /// The place of a cell's runs.
    pub fn of(cell: &Cell) -> Self {
        Self::new([cell.params_nonvocab, cell.n_vocab, cell.tokens], cell.unique_tokens)
    }
}

/// The parts of a loss at a place.
struct Parts {
    v: f64,
    n: f64,
    d: f64,
    model: f64,
    data: f64,
}

impl JointLoss {
    /// The same law with other coefficients.
    pub(in crate::laws) fn with(&self, values: &[f64]) -> Self {
        Self { values: values.to_vec(), ..self.clone() }
    }

    /// The loss of a model of N_nv parameters and V codes, trained on D tokens.
    pub fn at(&self, params_nonvocab: f64, n_vocab: f64, tokens: f64) -> f64 {
        self.value(&Place {
            ln_size: params_nonvocab.ln(),
            ln_vocab: if self.terms.vocab { n_vocab.ln() } else { self.centre[1] },
            ln_tokens: tokens.ln(),
            unique_tokens: self.unique_tokens,
        })
    }

    /// The coefficients by name, for N_nv, V and D themselves instead of their distances from the middle.
    ///
    /// E is the limit for infinite model, data and vocabulary, or, with few vocabularies, at V = 1; the loss falls with V
    /// by E_v ln V, or, saturating, by E_v (1 − V^−κe)/κe.
    pub fn coefficients(&self) -> Vec<(&'static str, f64)> {
        let ([n, v, d], terms) = (self.centre, self.terms);
        let (alpha, beta) = (self.values[ALPHA], self.values[BETA]);
        let [kappa_e, kappa_a, kappa_b] = [0, 1, 2].map(|i| self.kappa(i));
        let (e, e_v) = match terms.saturating {
            true => (self.values[0] - self.e1() / kappa_e, self.e1() * (kappa_e * v).exp()),
            false => (self.values[0] + self.e1() * v, self.e1()),
        };
        let a = (self.values[1] - kappa_a * v + alpha * n).exp();
        let b = (self.values[3] - kappa_b * v - self.chi() * n + beta * d).exp();
        let mut all = vec![("E", e), ("A", a), ("alpha", alpha), ("B", b), ("beta", beta)];
        all.extend(terms.vocab.then_some(("E_v", e_v)));
        let kappas = [("kappa_e", kappa_e), ("kappa_a", kappa_a), ("kappa_b", kappa_b)];
        all.extend(kappas.into_iter().filter(|_| terms.saturating));
        all.extend(terms.crossed.then(|| ("chi", self.chi())));
        let r = [("R", self.ln_r(0.0).exp()), ("rho", -self.ln_r(1.0) + self.ln_r(0.0))];
        all.extend(terms.repeats.then_some(r).into_iter().flatten());
        all
    }

    pub(in crate::laws) fn value(&self, place: &Place) -> f64 {
        let Parts { v, model, data, .. } = self.parts(place);
        self.limit(v) + model + data
    }

    /// The derivative of the loss by each coefficient.
    pub(in crate::laws) fn gradient(&self, place: &Place) -> Vec<f64> {
        self.with_slopes(place).1[..self.terms.count()].to_vec()
    }

    /// The loss, and its derivative by each coefficient.
    pub(super) fn with_slopes(&self, place: &Place) -> (f64, Row) {
        let Parts { v, n, d, model, data } = self.parts(place);
        let value = self.limit(v) + model + data;
        let mut row = [0.0; MOST];
        row[..BASE].copy_from_slice(&[1.0, model, -n * model, data, -d * data]);
        if self.terms.vocab {
            row[BASE] = -told(v, self.kappa(0));
        }
        if self.terms.saturating {
            let (first, kappa) = (self.terms.kappa_e(), self.kappa(0));
            let slope = (v * (-kappa * v).exp() - told(v, kappa)) / kappa;
            row[first..first + 3].copy_from_slice(&[-self.e1() * slope, v * model, v * data]);
        }
        if self.terms.crossed {
            row[self.terms.chi()] = n * data;
        }
        if self.terms.repeats {
            let step = 1e-4;
            let ln_r = self.ln_r(n);
            let worth = |ln_r: f64| worth(place.ln_tokens, place.unique_tokens, ln_r);
            let slope = (worth(ln_r + step) - worth(ln_r - step)) / (2.0 * step);
            let by_ln_r = -self.values[BETA] * data * slope;
            row[self.terms.ln_r()..][..2].copy_from_slice(&[by_ln_r, -n * by_ln_r]);
        }
        (value, row)
    }

    fn parts(&self, place: &Place) -> Parts {
        let [n, v] = [place.ln_size - self.centre[0], place.ln_vocab - self.centre[1]];
        let ln_tokens = match self.terms.repeats {
            true => worth(place.ln_tokens, place.unique_tokens, self.ln_r(n)),
            false => place.ln_tokens,
        };
        let d = ln_tokens - self.centre[2];
        let model = (self.values[1] + self.kappa(1) * v - self.values[ALPHA] * n).exp();
        let data =
            (self.values[3] + self.kappa(2) * v + self.chi() * n - self.values[BETA] * d).exp();
        Parts { v, n, d, model, data }
    }

    /// The loss at `v` where model and data are without end.
    fn limit(&self, v: f64) -> f64 {
        self.values[0] - self.e1() * told(v, self.kappa(0))
    }

    fn e1(&self) -> f64 {
        if self.terms.vocab { self.values[BASE] } else { 0.0 }
    }

    /// κe, κa or κb.
    fn kappa(&self, i: usize) -> f64 {
        if self.terms.saturating { self.values[self.terms.kappa_e() + i] } else { 0.0 }
    }

    fn chi(&self) -> f64 {
        if self.terms.crossed { self.values[self.terms.chi()] } else { 0.0 }
    }

    /// ln R of a model `n` above the middle one.
    fn ln_r(&self, n: f64) -> f64 {
        let at = self.terms.ln_r();
        if !self.terms.repeats {
            return 0.0;
        }
        self.values[at] - self.values[at + 1] * n
    }
}

/// The information gain of a vocabulary over the middle one, in units of e1: v, less for larger ones if κe > 0.
pub(super) fn told(v: f64, kappa_e: f64) -> f64 {
    if kappa_e == 0.0 { v } else { -(-kappa_e * v).exp_m1() / kappa_e }
}

/// ln of the worth of D tokens of which U are distinct.
fn worth(ln_tokens: f64, unique_tokens: Option<f64>, ln_r: f64) -> f64 {
    let Some(unique) = unique_tokens.filter(|unique| ln_tokens > unique.ln()) else {
        return ln_tokens;
    };
    let (repeats, r) = (ln_tokens.exp() / unique - 1.0, ln_r.exp());
    (unique * (1.0 - r * (-repeats / r).exp_m1())).ln()
}

// The worth of repeated data.

/// The worth of passes over the data to a model of the middle size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repetition {
    /// R: the worth of all passes after the first together, in first passes.
    pub r: f64,
    /// From run noise and scatter around the law; another form of the law may lie outside.
    pub r_ci95: Option<[f64; 2]>,
    /// R falls as N^−ρ.
    pub rho: f64,
    pub rho_ci95: Option<[f64; 2]>,
    /// The middle N_nv of the cells, to which R refers.
    pub params_nonvocab: f64,
}

impl Repetition {
    /// The worth of some passes, in first passes.
    pub fn worth(&self, passes: f64) -> f64 {
        worth(passes.ln(), Some(1.0), self.r.ln()).exp()
    }
}

// The cells that a loss is fitted to.

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

    pub fn centre(&self) -> [f64; 3] {
        let places: Vec<Place> = self.all.iter().map(|cell| Place::of(cell)).collect();
        let mean = |of: fn(&Place) -> f64| places.iter().map(of).sum::<f64>() / places.len() as f64;
        [mean(|place| place.ln_size), mean(|place| place.ln_vocab), mean(|place| place.ln_tokens)]
    }
}
