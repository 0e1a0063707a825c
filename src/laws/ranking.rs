//! Which law to believe: the one that predicts the sweep's own larger budgets from its smaller ones.

use super::joint::{JointLaw, above, fit_joint, repeat};
use super::law_set::{Columns, LawSet, geometric_mean, law_set};
use super::minima::Grid;
use super::stats::NORMAL_97_5;
use super::{
    Candidate, FitOptions, FloorLaw, Minimum, Miss, MissedMinimum, Off, Parameters, Recommended,
    RunNoise, Score, floor_law,
};
use crate::sweep::MinimumMethod;

/// Fewest budgets that a law is fitted to before it is tested.
const FEWEST: usize = 3;

/// All budgets of a sweep with their measured minima, ascending.
pub(super) struct Rows<'a> {
    pub grids: &'a [Grid],
    /// The minimum of each grid by the laws' method; none where it may not be used.
    pub minima: &'a [Option<Minimum>],
    pub noise: Option<RunNoise>,
    pub options: &'a FitOptions,
}

/// Power laws through minima.
struct Lines {
    set: LawSet,
    /// The law of the loss; none where it is the log law of the set.
    floor: Option<FloorLaw>,
    reference: f64,
}

/// A law through the first budgets of a sweep.
enum Fitted {
    Lines(Box<Lines>),
    Joint(Box<JointLaw>),
}

impl Rows<'_> {
    /// Every candidate's score, the best first; empty where there are too few budgets.
    pub fn scores(&self) -> Vec<Score> {
        // The joint law with repetition holds the other, R without end: where runs repeat their data it is
        // the one, and the other would learn of repetition by missing it.
        let unfit = if repeat(self.grids) { Candidate::Joint } else { Candidate::JointRepeats };
        let candidates = Candidate::ALL.into_iter().filter(|law| *law != unfit);
        let mut scores: Vec<Score> = candidates.filter_map(|law| self.score(law)).collect();
        let tests = |score: &Score| score.misses.iter().filter(|m| m.minimum.is_some()).count();
        let most = scores.iter().map(tests).max().unwrap_or(0);
        // One that could not be tested by every minimum is not compared.
        scores.retain(|score| tests(score) == most && score.rms.is_finite());
        scores.sort_by(|a, b| a.rms.total_cmp(&b.rms));
        scores
    }

    fn score(&self, law: Candidate) -> Option<Score> {
        let starts = FEWEST..self.grids.len();
        let misses: Vec<Miss> = starts.flat_map(|n| self.misses(law, n)).collect();
        let untold = Score { law, rms: f64::NAN, misses };
        let squares = untold.compared().map(|miss| miss.loss.by.powi(2));
        let rms = (squares.sum::<f64>() / untold.compared().count() as f64).sqrt();
        (!untold.misses.is_empty()).then_some(Score { rms, ..untold })
    }

    /// What a law through the first `n` budgets says of the others.
    fn misses(&self, law: Candidate, n: usize) -> Vec<Miss> {
        let Some(fitted) = self.fit(law, n) else { return Vec::new() };
        let largest = self.grids[n - 1].budget_flops;
        let measured = self.grids[n..].iter().zip(&self.minima[n..]);
        // Laws are compared by budgets that all of them can be asked of.
        let compared = self.fitted_minima(n).is_some();
        let miss = |(grid, minimum): (&Grid, &Option<Minimum>)| {
            let minimum = minimum.as_ref().filter(|_| compared);
            let (loss, minimum) = self.missed(&fitted, grid, minimum)?;
            let (budget_flops, factor) = (grid.budget_flops, grid.budget_flops / largest);
            Some(Miss { n_fitted: n, budget_flops, factor, loss, minimum })
        };
        measured.filter_map(miss).collect()
    }

    fn fit(&self, law: Candidate, n: usize) -> Option<Fitted> {
        if law.is_joint() {
            let repeats = law == Candidate::JointRepeats;
            let joint = fit_joint(&self.grids[..n], self.noise, repeats)?;
            return Some(Fitted::Joint(Box::new(joint)));
        }
        let used = self.fitted_minima(n)?;
        let columns = Columns::new(&used, self.grids, self.options);
        let reference = geometric_mean(&columns.compute);
        let set = law_set(&columns, reference, self.options)?;
        let floor = match law {
            Candidate::Log => None,
            _ => Some(floor_law(&columns.compute, &columns.loss, reference)?),
        };
        Some(Fitted::Lines(Box::new(Lines { set, floor, reference })))
    }

    /// The minima that power laws through the first `n` budgets are fitted to; none where they are too few.
    fn fitted_minima(&self, n: usize) -> Option<Vec<Minimum>> {
        let used: Vec<Minimum> = self.minima[..n].iter().flatten().cloned().collect();
        (used.len() >= FEWEST).then_some(used)
    }

    /// What a law misses a budget's loss by, and its minimum.
    fn missed(
        &self,
        fitted: &Fitted,
        grid: &Grid,
        measured: Option<&Minimum>,
    ) -> Option<(Off, Option<MissedMinimum>)> {
        let said = fitted.at(grid.budget_flops)?;
        let minimum = measured.map(|measured| self.missed_minimum(said, measured));
        let loss = match fitted {
            Fitted::Joint(joint) => above(joint, grid, self.noise),
            Fitted::Lines(_) => Off {
                by: minimum?.loss,
                measured_to: deviation(measured?.ci95.unwrap_or_default().loss_normalised, |x| x),
            },
        };
        Some((loss, minimum))
    }

    fn missed_minimum(&self, said: Said, measured: &Minimum) -> MissedMinimum {
        let ci = measured.ci95.unwrap_or_default();
        let off = |said: f64, measured: f64, measured_to: f64| Off {
            by: (said / measured).ln(),
            measured_to,
        };
        let ln_size = deviation(ci.params_nonvocab, f64::ln);
        let ln_vocab = deviation(ci.params_vocab, f64::ln);
        // D = C / 6(N_nv + N_v), its logarithm to first order.
        let share = measured.params_vocab / (measured.params_nonvocab + measured.params_vocab);
        let ln_tokens = ((1.0 - share) * ln_size).hypot(share * ln_vocab);
        let split = self.options.parameters == Parameters::Split;
        let vocab = || off(said.params_vocab, measured.params_vocab, ln_vocab);
        MissedMinimum {
            loss: said.loss - measured.loss_normalised,
            ln_size: off(said.params_nonvocab, measured.params_nonvocab, ln_size),
            ln_vocab: if split { vocab() } else { Off::default() },
            ln_tokens: off(said.tokens, measured.tokens, ln_tokens),
        }
    }
}

/// What a law says of a budget.
#[derive(Clone, Copy)]
struct Said {
    loss: f64,
    params_nonvocab: f64,
    params_vocab: f64,
    tokens: f64,
}

impl Fitted {
    fn at(&self, budget: f64) -> Option<Said> {
        match self {
            Self::Joint(joint) => joint.optimum(budget).map(|best| Said {
                loss: best.loss,
                params_nonvocab: best.params_nonvocab,
                params_vocab: best.params_vocab,
                tokens: best.tokens,
            }),
            Self::Lines(lines) => Some(lines.at(budget)),
        }
    }
}

impl Lines {
    fn at(&self, budget: f64) -> Said {
        let Self { set, floor, reference } = self;
        Said {
            loss: match floor {
                Some(floor) => floor.loss_at(budget, *reference),
                None => set.loss.loss_at(budget),
            },
            params_nonvocab: set.params_nonvocab.value_at(budget),
            params_vocab: set.params_vocab.as_ref().map_or(0.0, |law| law.value_at(budget)),
            tokens: set.tokens.value_at(budget),
        }
    }
}

/// The standard deviation of a normal quantity of this interval; 0 where there is none.
fn deviation(interval: Option<[f64; 2]>, of: fn(f64) -> f64) -> f64 {
    interval.map_or(0.0, |[low, high]| (of(high) - of(low)) / (2.0 * NORMAL_97_5))
}

/// The best of some scores, or the log law where nothing could be tested.
pub(super) fn recommended(
    scores: Vec<Score>,
    minima_method: MinimumMethod,
    budgets: usize,
) -> Recommended {
    let law = scores.first().map_or(Candidate::Log, |best| best.law);
    let why = match (scores.first(), scores.last()) {
        (Some(best), Some(worst)) if scores.len() > 1 => format!(
            "fitted to smaller budgets, it missed the losses of larger ones by {:.4} nats (root mean \
             square of {}), {} by {:.4}",
            best.rms,
            best.compared().count(),
            worst.law.about(),
            worst.rms
        ),
        (Some(_), _) => "no other law could be tested".to_string(),
        (None, _) => format!("{budgets} budgets are too few to test any law, so ScaMo's stands"),
    };
    Recommended { law, minima_method, why, scores }
}
