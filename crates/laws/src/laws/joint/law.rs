//! A joint law as stored in `laws.json`: the loss, the cost of a token, and results of both.

use rayon::prelude::*;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::loss::{JointLoss, Place, Repetition};
use crate::laws::input::Cell;
use crate::laws::maths::least_squares;
use crate::laws::maths::stats::{extent, interval95};
use crate::laws::minima::{Grid, Optimum, valley};

/// A joint law, and all that a prediction needs of the cells it was fitted to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(remote = "Self")]
pub struct JointLaw {
    pub loss: JointLoss,
    pub(super) cost: Cost,
    /// Root mean square of the residuals, in nats, on the degrees of freedom that the fit leaves.
    pub residual_sd: f64,
    /// Degrees of freedom of its square.
    pub dof: usize,
    /// Cells fitted.
    pub n: usize,
    /// The coefficients of each bootstrap replicate.
    #[serde(default)]
    pub bootstrap: Vec<Vec<f64>>,
}

impl Serialize for JointLaw {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Self::serialize(self, serializer)
    }
}

impl<'de> Deserialize<'de> for JointLaw {
    fn deserialize<D: Deserializer<'de>>(file: D) -> Result<Self, D::Error> {
        let law = Self::deserialize(file)?;
        let count = law.loss.terms.count();
        let all = || [&law.loss.values].into_iter().chain(&law.bootstrap);
        let other = all().map(Vec::len).find(|len| *len != count);
        match other {
            None => Ok(law),
            Some(other) => Err(D::Error::custom(format!(
                "the joint law has {other} coefficients, and its terms ask for {count}"
            ))),
        }
    }
}

impl JointLaw {
    /// Whether it has the worth of repeated data, with its uncertainty.
    pub fn tells_repetition(&self) -> bool {
        self.loss.terms.repeats && !self.bootstrap.is_empty()
    }

    /// The law where `unique_tokens` are distinct.
    pub fn on_data(&self, unique_tokens: f64) -> Self {
        let mut law = self.clone();
        law.loss.unique_tokens = Some(unique_tokens);
        law
    }

    /// The best allocation of `budget` FLOPs.
    pub fn optimum(&self, budget: f64) -> Option<Optimum> {
        self.cost.optimum(&self.loss, budget)
    }

    /// An optimum at an end of the range searched, and the ends: the loss has no minimum between them.
    pub fn at_an_end(&self, optimum: &Optimum) -> Option<(&'static str, [f64; 2])> {
        let is_end = |x: f64, [low, high]: [f64; 2]| {
            (x.ln() - low).min(high - x.ln()) < AT_AN_END * (high - low)
        };
        let size = ("size", optimum.params_nonvocab, Some(self.cost.sizes_looked_at()));
        let vocab = (
            "vocabulary",
            optimum.n_vocab.unwrap_or_default(),
            self.cost.vocabularies_looked_at(&self.loss),
        );
        [size, vocab].into_iter().find_map(|(what, x, range)| {
            range.filter(|range| is_end(x, *range)).map(|range| (what, range.map(f64::exp)))
        })
    }

    /// The best allocations of some budgets by each replicate, if it has them.
    pub fn optima_at<const N: usize>(&self, budgets: [f64; N]) -> Vec<[Option<Optimum>; N]> {
        let of = |values: &Vec<f64>| {
            let loss = self.loss.with(values);
            budgets.map(|budget| self.cost.optimum(&loss, budget))
        };
        self.bootstrap.par_iter().map(of).collect()
    }

    /// The loss of an allocation by each replicate. The least loss of each replicate would lie lower: a surface
    /// that is moved at random has its minimum where chance made it low.
    pub fn losses_at(&self, place: &Optimum) -> Vec<f64> {
        let Optimum { params_nonvocab, n_vocab, tokens, .. } = *place;
        let of = |values: &Vec<f64>| {
            self.loss.with(values).at(params_nonvocab, n_vocab.unwrap_or_default(), tokens)
        };
        self.bootstrap.iter().map(of).filter(|loss| loss.is_finite()).collect()
    }

    /// The best allocation by each replicate that has one.
    pub fn optima(&self, budget: f64) -> Vec<Optimum> {
        self.optima_at([budget]).into_iter().filter_map(|[optimum]| optimum).collect()
    }

    /// A model of `params_nonvocab` parameters and `n_vocab` codes, trained on `tokens`.
    pub fn sized(&self, params_nonvocab: f64, n_vocab: Option<f64>, tokens: f64) -> SizedLoss {
        let v = n_vocab.unwrap_or_default();
        let params_vocab = self.cost.params_vocab(params_nonvocab, v);
        let flops = tokens / self.cost.tokens(1.0, params_nonvocab, params_vocab);
        let pair = |loss: &JointLoss| {
            let best = self.cost.optimum(loss, flops)?;
            Some((loss.at(params_nonvocab, v, tokens), best))
        };
        let replicate = |values: &Vec<f64>| {
            let (loss, best) = pair(&self.loss.with(values))?;
            Some([loss, best.loss])
        };
        SizedLoss {
            flops,
            params_vocab,
            n_vocab,
            loss: self.loss.at(params_nonvocab, v, tokens),
            best: pair(&self.loss).map(|(_, best)| best),
            replicates: self.bootstrap.iter().filter_map(replicate).collect(),
        }
    }

    /// V of a model whose vocabulary has `params_vocab` parameters.
    pub fn codes(&self, params_nonvocab: f64, params_vocab: f64) -> f64 {
        params_vocab / self.cost.params_vocab(params_nonvocab, 1.0)
    }

    /// The weight in the fit of a run `above` the best loss of its budget, 1 for the best run, given the
    /// standard deviation `sd` of a run.
    pub fn counts(above: f64, sd: f64) -> f64 {
        valley(above, sd)
    }

    /// The worth of repeated data; `None` without a term for it.
    pub fn repetition(&self) -> Option<Repetition> {
        let terms = self.loss.terms;
        terms.repeats.then(|| {
            let at = terms.ln_r();
            let all =
                |i: usize| self.bootstrap.iter().map(|values| values[at + i]).collect::<Vec<_>>();
            Repetition {
                r: self.loss.values[at].exp(),
                r_ci95: interval95(all(0)).map(|ends| ends.map(f64::exp)),
                rho: self.loss.values[at + 1],
                rho_ci95: interval95(all(1)),
                params_nonvocab: self.loss.centre[0].exp(),
            }
        })
    }

    /// Its mean error over the valley of a budget, and the standard deviation of that mean given the `noise` of a run.
    pub(in crate::laws) fn above(&self, grid: &Grid, noise: f64) -> Off {
        let best = grid.best().loss;
        let [mut counts, mut sum, mut variance] = [0.0; 3];
        for cell in &grid.cells {
            let count = cell.runs * valley(cell.loss - best, noise);
            counts += count;
            sum += count * (self.loss.value(&Place::of(cell)) - cell.loss);
            variance += count.powi(2) * noise.powi(2) / cell.runs;
        }
        Off { by: sum / counts, measured_to: variance.sqrt() / counts }
    }
}

/// A model trained on some tokens, and the best model for the same FLOPs.
#[derive(Clone, Debug, PartialEq)]
pub struct SizedLoss {
    pub flops: f64,
    pub params_vocab: f64,
    /// V, if the law or the caller gives it.
    pub n_vocab: Option<f64>,
    pub loss: f64,
    /// `None` if the law has no finite optimum there.
    pub best: Option<Optimum>,
    /// The loss, and the best model's loss, by each bootstrap replicate with both.
    pub replicates: Vec<[f64; 2]>,
}

/// Predicted less measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Off {
    pub by: f64,
    /// The standard deviation of the measurement; 0 if unknown.
    pub measured_to: f64,
}

impl Off {
    /// The squared error of the law itself.
    pub(in crate::laws) fn own_square(self) -> f64 {
        self.by.powi(2) - self.measured_to.powi(2)
    }
}

// The cost of a token, the width of a model, and the best allocation.

/// Factors beyond the sizes and vocabularies tried within which an optimum is searched.
const BELOW: f64 = 8.0;
const SIZES_ABOVE: f64 = 1e4;
const VOCABULARIES_ABOVE: f64 = 64.0;
/// Halvings of a golden section: a logarithm to a thousandth.
const STEPS: usize = 28;
/// The share of all that is looked at, in logarithms, within which an optimum lies at an end.
const AT_AN_END: f64 = 1e-3;

/// FLOPs of a trained token and the width, as functions of N_nv.
///
/// C/D = `per_param` N_nv + `per_root` √N_nv + `per_vocab` N_v. Under `6nd` it is exact; under the
/// other rules it is where all models have one depth, whose attention costs a multiple of the width.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Cost {
    per_param: f64,
    per_root: f64,
    per_vocab: f64,
    /// ln d = `ln_width` + `width_exponent` ln N_nv; none if V is not known.
    width: Option<[f64; 2]>,
    /// The sizes and the vocabularies that were tried.
    pub sizes: [f64; 2],
    pub vocabularies: [f64; 2],
}

impl Cost {
    /// Fits the cost to some cells; `None` if they do not determine it.
    pub fn of(cells: &[&Cell]) -> Option<Self> {
        let has_vocab = cells.iter().all(|cell| cell.has_vocabulary());
        let [per_param, per_root, per_vocab] = per_token(cells, has_vocab)?;
        let range = |of: fn(&Cell) -> f64| extent(cells.iter().map(|cell| of(cell)));
        Some(Self {
            per_param,
            per_root,
            per_vocab,
            width: if has_vocab { Some(width(cells)?) } else { None },
            sizes: range(|cell| cell.params_nonvocab),
            vocabularies: range(|cell| cell.n_vocab),
        })
    }

    /// N_v of a model of N_nv parameters with V codes.
    pub fn params_vocab(&self, params_nonvocab: f64, n_vocab: f64) -> f64 {
        let width = |[a, b]: [f64; 2]| (a + b * params_nonvocab.ln()).exp();
        self.width.map_or(0.0, |line| n_vocab * width(line))
    }

    /// D that `budget` buys.
    pub fn tokens(&self, budget: f64, params_nonvocab: f64, params_vocab: f64) -> f64 {
        let of_model = self.per_param * params_nonvocab + self.per_root * params_nonvocab.sqrt();
        budget / (of_model + self.per_vocab * params_vocab)
    }

    /// The optimum of `loss` at `budget` FLOPs; `None` if it is not finite.
    pub fn optimum(&self, loss: &JointLoss, budget: f64) -> Option<Optimum> {
        let sizes = self.sizes_looked_at();
        let best_of = |ln_vocab: f64| {
            let at = |ln_size: f64| self.at(loss, budget, ln_size, ln_vocab);
            golden(sizes, |ln_size| at(ln_size).loss)
                .map_or(f64::INFINITY, |ln_size| at(ln_size).loss)
        };
        let ln_vocab = match self.vocabularies_looked_at(loss) {
            Some(range) => golden(range, best_of)?,
            None => self.vocabularies[0].max(f64::MIN_POSITIVE).ln(),
        };
        let ln_size = golden(sizes, |ln_size| self.at(loss, budget, ln_size, ln_vocab).loss)?;
        let best = self.at(loss, budget, ln_size, ln_vocab);
        (best.loss.is_finite() && best.tokens.is_finite()).then_some(best)
    }

    /// ln N_nv.
    fn sizes_looked_at(&self) -> [f64; 2] {
        let [low, high] = self.sizes.map(f64::ln);
        [low - BELOW.ln(), high + SIZES_ABOVE.ln()]
    }

    /// ln V, if several vocabularies were tried.
    fn vocabularies_looked_at(&self, loss: &JointLoss) -> Option<[f64; 2]> {
        let [low, high] = self.vocabularies.map(f64::ln);
        loss.terms.vocab.then_some([low - BELOW.ln(), high + VOCABULARIES_ABOVE.ln()])
    }

    fn at(&self, loss: &JointLoss, budget: f64, ln_size: f64, ln_vocab: f64) -> Optimum {
        let (params_nonvocab, n_vocab) = (ln_size.exp(), ln_vocab.exp());
        let params_vocab = self.params_vocab(params_nonvocab, n_vocab);
        let tokens = self.tokens(budget, params_nonvocab, params_vocab);
        Optimum {
            params_nonvocab,
            params_vocab,
            n_vocab: (params_vocab > 0.0).then_some(n_vocab),
            tokens,
            loss: loss.at(params_nonvocab, n_vocab, tokens),
        }
    }
}

/// The three prices of least relative error, none of them below zero.
fn per_token(cells: &[&Cell], has_vocab: bool) -> Option<[f64; 3]> {
    let columns =
        |cell: &Cell| [cell.params_nonvocab, cell.params_nonvocab.sqrt(), cell.params_vocab];
    let sets: &[&[usize]] =
        if has_vocab { &[&[0, 1, 2], &[0, 2], &[1, 2], &[0]] } else { &[&[0, 1], &[0], &[1]] };
    sets.iter().find_map(|set| {
        let price = |cell: &Cell| cell.flops / cell.tokens;
        let row = |cell: &&Cell| set.iter().map(|i| columns(cell)[*i] / price(cell)).collect();
        let rows: Vec<Vec<f64>> = cells.iter().map(row).collect();
        let fit = least_squares(&rows, &vec![1.0; rows.len()])?;
        let mut prices = [0.0; 3];
        set.iter().zip(&fit.coefficients).for_each(|(i, price)| prices[*i] = *price);
        prices.iter().all(|price| *price >= 0.0).then_some(prices)
    })
}

/// The line of ln d in ln N_nv; constant if one size was tried.
fn width(cells: &[&Cell]) -> Option<[f64; 2]> {
    let widths: Vec<f64> = cells.iter().map(|cell| cell.ln_width()).collect();
    let rows: Vec<Vec<f64>> =
        cells.iter().map(|cell| vec![1.0, cell.params_nonvocab.ln()]).collect();
    let level = || least_squares(&vec![vec![1.0]; widths.len()], &widths);
    let line = least_squares(&rows, &widths).or_else(level)?.coefficients;
    Some([line[0], line.get(1).copied().unwrap_or(0.0)])
}

/// The minimum of a function with one valley; `None` if it is not finite there.
fn golden([mut low, mut high]: [f64; 2], f: impl Fn(f64) -> f64) -> Option<f64> {
    let ratio = (5f64.sqrt() - 1.0) / 2.0;
    let (mut a, mut b) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut at_a, mut at_b) = (f(a), f(b));
    for _ in 0..STEPS {
        if at_a < at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - ratio * (high - low);
            at_a = f(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + ratio * (high - low);
            at_b = f(b);
        }
    }
    at_a.min(at_b).is_finite().then_some(0.5 * (low + high))
}
