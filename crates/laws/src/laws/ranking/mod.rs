//! Ranks laws by how well they predict the sweep's larger budgets from its smaller ones.

mod recommended;

pub use recommended::{
    Belief, Candidate, Deviations, ForecastError, Miss, MissedMinimum, Recommended, Score,
};

use crate::laws::input::{FitOptions, MinimumMethod, Parameters};
use crate::laws::joint::{JointLaw, Off, fit_joint, repeat};
use crate::laws::lines::LawSet;
use crate::laws::maths::stats::{NORMAL_97_5, distinct};
use crate::laws::minima::{
    Grid, Minimum, MinimumIntervals, Optimum, RunNoise, of_grids, tell_laws, usable,
};

/// All budgets of a sweep, ascending.
pub(super) struct Rows<'a> {
    pub grids: &'a [Grid],
    /// The runs of the largest share of the data, and of each smaller one.
    pub shares: Vec<OfShare>,
    pub noise: Option<RunNoise>,
    pub options: &'a FitOptions,
}

impl Rows<'_> {
    /// Every candidate's score, the best first; empty if there are too few budgets.
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

    /// The errors of a law fitted to the first `n` budgets on the others, share by share.
    fn misses(&self, law: Candidate, n: usize) -> Vec<Miss> {
        if law.is_joint() {
            let joint = fit_joint(&self.grids[..n], self.noise, law == Candidate::JointRepeats);
            let Some(joint) = joint.map(|joint| Fitted::Joint(Box::new(joint))) else {
                return Vec::new();
            };
            return self.shares.iter().flat_map(|own| self.misses_of(&joint, own, n)).collect();
        }
        let of_share = |own: &OfShare| {
            let lines = LawSet::through(&own.fitted_minima(n)?, self.grids, self.options)?;
            Some(self.misses_of(&Fitted::Lines(Box::new(lines), law), own, n))
        };
        self.shares.iter().filter_map(of_share).flatten().collect()
    }

    /// The errors of a law on the budgets of a share after the first `n`.
    fn misses_of(&self, fitted: &Fitted, own: &OfShare, n: usize) -> Vec<Miss> {
        let largest = self.grids[n - 1].budget_flops;
        // Laws are compared by budgets that all of them can be asked of.
        let compared = own.fitted_minima(n).is_some();
        let miss = |(i, measured): (usize, &OfBudget)| {
            let minimum = measured.minimum.as_ref().filter(|_| compared);
            let exact_to = &self.shares[0].budgets[i];
            let exact_to = exact_to.as_ref().and_then(|largest| largest.minimum.as_ref()?.ci95);
            let measured_to = exact_to.unwrap_or_default();
            let (loss, minimum) = self.missed(fitted, &measured.grid, (minimum, measured_to))?;
            let budget_flops = measured.grid.budget_flops;
            let factor = budget_flops / largest;
            Some(Miss { n_fitted: n, share: own.of_largest, budget_flops, factor, loss, minimum })
        };
        let later = own.budgets.iter().enumerate().skip(n);
        later.filter_map(|(i, own)| miss((i, own.as_ref()?))).collect()
    }

    /// The error of a law at a budget's loss and minimum, measured as precisely as in the largest share.
    fn missed(
        &self,
        fitted: &Fitted,
        grid: &Grid,
        (measured, measured_to): (Option<&Minimum>, MinimumIntervals),
    ) -> Option<(Off, Option<MissedMinimum>)> {
        let said = fitted.at(grid)?;
        let minimum = measured.map(|measured| self.missed_minimum(said, measured, measured_to));
        let at_minimum = |minimum: MissedMinimum| Off {
            by: minimum.loss,
            measured_to: deviation(measured_to.loss_normalised, |x| x),
        };
        let loss = match (fitted, minimum) {
            // A minimum is read off the best vocabulary of a grid, and lies above the optimum between two.
            (Fitted::Joint(joint), Some(minimum)) if !joint.loss.terms.vocab => at_minimum(minimum),
            (Fitted::Joint(joint), _) => {
                joint.above(grid, RunNoise::sd_or_guess(self.noise, self.grids))
            }
            (Fitted::Lines(..), minimum) => at_minimum(minimum?),
        };
        Some((loss, minimum))
    }

    fn missed_minimum(
        &self,
        said: Optimum,
        measured: &Minimum,
        ci: MinimumIntervals,
    ) -> MissedMinimum {
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

/// The standard deviation of a normal quantity of this interval; 0 if there is none.
fn deviation(interval: Option<[f64; 2]>, of: fn(f64) -> f64) -> f64 {
    interval.map_or(0.0, |[low, high]| (of(high) - of(low)) / (2.0 * NORMAL_97_5))
}

// The tests of laws: the budgets of each share of the data, with their minima.

/// Fewest budgets that a law is fitted to before it is tested.
const FEWEST: usize = 3;

/// Runs that saw one share of the data.
///
/// Laws of minima are of one share and are tested within it; a joint law is of all shares and is tested in
/// each. Where a share is small its larger budgets repeat it as those do that the whole will be asked for.
pub(super) struct OfShare {
    /// 1 for the largest.
    pub of_largest: f64,
    /// One per budget, in the order of the rows; `None` without such a run.
    pub budgets: Vec<Option<OfBudget>>,
}

/// One budget's runs of a share.
pub(super) struct OfBudget {
    pub grid: Grid,
    /// By the laws' method; none if it may not be used.
    pub minimum: Option<Minimum>,
}

impl OfShare {
    /// The minima that power laws through the first `n` budgets are fitted to; none if they are too few.
    fn fitted_minima(&self, n: usize) -> Option<Vec<Minimum>> {
        let minima = self.budgets[..n].iter().flatten().filter_map(|own| own.minimum.clone());
        let used: Vec<Minimum> = minima.collect();
        tell_laws(&used).then_some(used)
    }
}

/// The runs of each share of the data with their minima by a method where these may be used, the largest
/// share first; `own` are the minima of that one.
pub(super) fn shares(
    grids: &[Grid],
    (method, own): (MinimumMethod, &[Minimum]),
    noise: Option<RunNoise>,
    options: &FitOptions,
) -> Vec<OfShare> {
    let largest = grids.first().map_or(1.0, |grid| grid.best().share);
    let mut all = vec![of_share(1.0, grids.iter().cloned().map(Some), &usable(own, options))];
    let smaller = grids.iter().flat_map(|grid| &grid.smaller).map(|cells| cells[0].share);
    for share in distinct(smaller) {
        let grids: Vec<Option<Grid>> = grids.iter().map(|grid| grid.of_share(share)).collect();
        let known: Vec<Grid> = grids.iter().flatten().cloned().collect();
        let minima = of_grids(method, &known, noise);
        all.push(of_share(share / largest, grids.into_iter(), &usable(&minima, options)));
    }
    all
}

fn of_share(
    of_largest: f64,
    grids: impl Iterator<Item = Option<Grid>>,
    usable: &[Minimum],
) -> OfShare {
    let budget = |grid: Grid| {
        let minimum = usable.iter().find(|m| m.budget_flops == grid.budget_flops).cloned();
        OfBudget { grid, minimum }
    };
    OfShare { of_largest, budgets: grids.map(|grid| grid.map(budget)).collect() }
}

// Laws through the first budgets.

/// A law through the first budgets of a sweep.
enum Fitted {
    /// By the log law of the loss, or the law with a floor.
    Lines(Box<LawSet>, Candidate),
    Joint(Box<JointLaw>),
}

impl Fitted {
    /// The prediction at the budget of some runs; for a joint law with their distinct tokens. `None` without such a law of
    /// the loss.
    fn at(&self, grid: &Grid) -> Option<Optimum> {
        let budget = grid.budget_flops;
        let (set, law) = match self {
            Self::Joint(joint) => {
                let unique = grid.best().unique_tokens;
                return unique.map_or_else(|| *joint.clone(), |u| joint.on_data(u)).optimum(budget);
            }
            Self::Lines(set, law) => (set, *law),
        };
        let by_floor = || Some(set.floor.as_ref()?.loss_at(budget, set.reference));
        Some(Optimum {
            loss: if law == Candidate::Log { set.log.loss_at(budget) } else { by_floor()? },
            params_nonvocab: set.params_nonvocab.value_at(budget),
            params_vocab: set.params_vocab.as_ref().map_or(0.0, |law| law.value_at(budget)),
            n_vocab: None,
            tokens: set.tokens.value_at(budget),
        })
    }
}
