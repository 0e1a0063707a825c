//! Which law to believe: the one that predicts the sweep's own larger budgets from its smaller ones.

pub(in crate::laws) mod fitted;
pub(in crate::laws) mod forecast_error;
pub(in crate::laws) mod miss;
pub(in crate::laws) mod recommended;
pub(in crate::laws) mod shares;

use self::miss::{Miss, MissedMinimum};
use self::recommended::{Candidate, Score};
use crate::laws::input::options::FitOptions;
use crate::laws::input::point::Parameters;
use crate::laws::joint::above;
use crate::laws::joint::above::Off;
use crate::laws::joint::fit::fit_joint;
use crate::laws::joint::weighed::repeat;
use crate::laws::lines::law_set::LawSet;
use crate::laws::maths::stats::NORMAL_97_5;
use crate::laws::minima::grid::Grid;
use crate::laws::minima::run_noise::RunNoise;
use crate::laws::minima::types::Optimum;
use crate::laws::minima::types::{Minimum, MinimumIntervals};
use fitted::Fitted;
pub(super) use shares::shares;
use shares::{FEWEST, OfBudget, OfShare};

/// All budgets of a sweep, ascending.
pub(super) struct Rows<'a> {
    pub grids: &'a [Grid],
    /// The runs of the largest share of the data, and those of each smaller one.
    pub shares: Vec<OfShare>,
    pub noise: Option<RunNoise>,
    pub options: &'a FitOptions,
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

    /// What a law through the first `n` budgets says of the others, share after share.
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

    /// What a law says of the budgets of a share after the first `n`.
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

    /// What a law misses a budget's loss by, and its minimum, which is measured as exactly as that of the
    /// largest share.
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
            (Fitted::Joint(joint), _) => above(joint, grid, self.noise),
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

/// The standard deviation of a normal quantity of this interval; 0 where there is none.
fn deviation(interval: Option<[f64; 2]>, of: fn(f64) -> f64) -> f64 {
    interval.map_or(0.0, |[low, high]| (of(high) - of(low)) / (2.0 * NORMAL_97_5))
}
