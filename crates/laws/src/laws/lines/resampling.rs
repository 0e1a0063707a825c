//! Uncertainty of laws: replicates of a sweep, for intervals, and errors on budgets left out of the fit.
//!
//! A replicate keeps every cell of the sweep and adds to its mean loss a normal draw of run noise, σ/√S for a cell of S
//! runs; minima and laws are then refitted. σ is estimated
//! ([`run_noise`](crate::laws::noise::run_noise)), so each replicate draws its own, σ √(ν/χ²_ν), which
//! makes the intervals as wide as Student's if the degrees of freedom ν are few. If σ comes from several runs per
//! cell, this is the bootstrap clustered by seed, in its parametric form: drawing among two or three runs with
//! replacement would understate their variance by a half or a third. Runs themselves are not drawn, because a
//! resample leaves out a third of the cells; intervals would then include the choice of the grid and cover too often.
//!
//! The means contain run noise already, so a replicate has it twice: the lowest of several means, the vocabulary of
//! each size, is chosen under more noise than in the sweep. In simulated sweeps (`docs/coverage.md`) the
//! percentiles of such replicates have the right coverage; basic intervals cover too little, and noise around a
//! smooth surface instead of the means adds that surface's misfit.
//!
//! Four more sources of error perturb a replicate. Tokenizers: all runs of a vocabulary move together, by the scatter
//! between its tokenizers. Misfit: if the curves miss the runs by more than noise, runs move by as much more. Method:
//! laws use the minima of each kind of curve in turn. Test split: cells move by the slopes of other clips. Each can
//! be asked for alone ([`Sources`]). The last one moves only laws: minima are compared with forecasts measured on
//! the same clips.
//!
//! A budget without a minimum inside the grid is left out of that replicate's laws, as in the fit, unless flagged
//! minima are kept; then its best run counts, as in the fit.
//!
//! Replicate i draws from ChaCha8's stream i of the seed, so the samples do not depend on the
//! number of threads.

use super::{Columns, LawSet, PowerLaw, ReplicateLaws, law_set};
use crate::laws::input::{FitOptions, MinimumMethod, Parameters};
use crate::laws::maths::stats::{Normals, interval95};
use crate::laws::minima::{
    Grid, Minimum, MinimumIntervals, NoiseSource, RunNoise, n_vocabularies, of_grid,
};
use crate::laws::noise::{OtherClips, TestNoise, TokenizerNoise};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The input of the replicates.
#[derive(Clone)]
pub(in crate::laws) struct Bootstrap<'a> {
    /// The cells of each budget.
    pub grids: &'a [Grid],
    /// The kinds of minimum to find in each replicate.
    pub methods: &'a [MinimumMethod],
    /// The kind the laws are fitted to; one of `methods`.
    pub method: MinimumMethod,
    /// The minima that the laws are fitted to.
    pub used: &'a [Minimum],
    /// C0.
    pub reference: f64,
    pub noise: RunNoise,
    pub tokenizers: Option<&'a TokenizerNoise>,
    pub test: Option<&'a TestNoise>,
    /// The ratio of the squared distance from the curves to the variance of runs; at least 1.
    pub misfit: f64,
    /// The kinds of minimum that laws may go through, as indices into `methods`.
    pub admissible: Vec<usize>,
    pub sources: Sources,
    pub options: &'a FitOptions,
}

/// The sources of error in an interval.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::laws) struct Sources {
    pub runs: bool,
    pub tokenizers: bool,
    pub misfit: bool,
    pub method: bool,
    pub test: bool,
}

impl Sources {
    pub const ALL: Self =
        Self { runs: true, tokenizers: true, misfit: true, method: true, test: true };
}

/// The result of one replicate.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::laws) struct Replicate {
    /// `None` if fewer than two budgets have a minimum.
    pub laws: Option<ReplicateLaws>,
    /// N_nv, N_v and L of the minima: for each method every budget.
    pub minima: Vec<[f64; 3]>,
}

impl Bootstrap<'_> {
    /// The replicates in order, as many as the options ask for.
    pub fn replicates(&self) -> Vec<Replicate> {
        (0..self.options.bootstrap).into_par_iter().map(|i| self.replicate(i as u64)).collect()
    }

    fn replicate(&self, stream: u64) -> Replicate {
        let mut normals = Normals::of_stream(self.options.seed, stream);
        let dof = self.noise.dof;
        let drawn_sd = (dof as f64 / normals.chi_square(dof)).sqrt();
        let tokenizers = self.tokenizers.filter(|_| self.sources.tokenizers);
        let shifts = tokenizers.map(|noise| noise.shifts(&mut normals)).unwrap_or_default();
        let clips = self.test.filter(|_| self.sources.test).map(|noise| noise.draw(&mut normals));
        let noisy = |grid: &Grid| {
            let sd = drawn_sd * self.sd_of_runs(grid);
            grid.with_losses(|cell| {
                cell.loss + shifts.of(cell.n_vocab) + sd / cell.runs.sqrt() * normals.draw()
            })
        };
        let drawn: Vec<Grid> = self.grids.iter().map(noisy).collect();
        let of = |method| drawn.iter().map(move |grid| of_grid(method, grid));
        let minima: Vec<Minimum> = self.methods.iter().copied().flat_map(of).collect();
        let fitted = self.method_of(stream).map(|own| match &clips {
            Some(clips) => on_other_clips(clips, self.methods[own], &drawn),
            None => minima[own * drawn.len()..][..drawn.len()].to_vec(),
        });
        Replicate {
            laws: fitted.and_then(|fitted| self.laws(&fitted)),
            minima: minima
                .iter()
                .map(|m| [m.params_nonvocab, m.params_vocab, m.loss_normalised])
                .collect(),
        }
    }

    /// The kind of minimum of a replicate's laws.
    fn method_of(&self, stream: u64) -> Option<usize> {
        match self.sources.method {
            true => self.admissible.get(stream as usize % self.admissible.len().max(1)).copied(),
            false => self.methods.iter().position(|method| *method == self.method),
        }
    }

    /// The standard deviation that a single run of a budget is moved by.
    fn sd_of_runs(&self, grid: &Grid) -> f64 {
        let Sources { runs, misfit, .. } = self.sources;
        let variance =
            f64::from(u8::from(runs)) + f64::from(u8::from(misfit)) * (self.misfit - 1.0);
        variance.sqrt() * of_budget(grid, self.noise)
    }

    /// The laws through the minima of the fitted budgets.
    fn laws(&self, fitted: &[Minimum]) -> Option<ReplicateLaws> {
        let is_used = |m: &&Minimum| {
            let used = self.used.iter().any(|used| used.budget_flops == m.budget_flops);
            used && (self.options.keep_flagged || !m.is_best_run_instead())
        };
        let used: Vec<Minimum> = fitted.iter().filter(is_used).cloned().collect();
        let columns = Columns::new(&used, self.grids, self.options);
        let laws = law_set(&columns, self.reference, self.options)?;
        Some(ReplicateLaws {
            sample: laws.sample()?,
            vocab_from_nonvocab: laws.vocab_from_nonvocab.map(|law| law.exponent),
        })
    }
}

/// The minima of some budgets on another test split.
fn on_other_clips(clips: &OtherClips, method: MinimumMethod, grids: &[Grid]) -> Vec<Minimum> {
    let moved = |grid: &Grid| grid.with_losses(|cell| cell.loss + clips.shift(cell, grid.best()));
    grids.iter().map(|grid| of_grid(method, &moved(grid))).collect()
}

/// Degrees of freedom of the pooled scatter, added to a budget's own.
const POOLED_DOF: f64 = 5.0;

/// The noise of one budget's runs: from its own seeds, shrunk towards the pooled noise if they are few.
fn of_budget(grid: &Grid, pooled: RunNoise) -> f64 {
    if pooled.source != NoiseSource::Seeds {
        return pooled.sd;
    }
    let dof: usize = grid.cells.iter().map(|cell| cell.dof).sum();
    let spread: f64 = grid.cells.iter().map(|cell| cell.spread).sum();
    ((spread + POOLED_DOF * pooled.sd.powi(2)) / (dof as f64 + POOLED_DOF)).sqrt()
}

/// Minima in the order of [`Replicate::minima`] with their intervals; no interval if the best run replaces a
/// minimum.
pub(in crate::laws) fn minima_with_intervals(
    minima: impl Iterator<Item = Minimum>,
    replicates: &[Replicate],
) -> Vec<Minimum> {
    let with = |(index, minimum): (usize, Minimum)| {
        if minimum.is_best_run_instead() {
            return minimum;
        }
        let interval = |i: usize| interval95(replicates.iter().map(|r| r.minima[index][i]));
        let intervals = MinimumIntervals {
            params_nonvocab: interval(0),
            params_vocab: interval(1).filter(|_| minimum.params_vocab > 0.0),
            loss_normalised: interval(2),
        };
        Minimum { ci95: intervals.loss_normalised.map(|_| intervals), ..minimum }
    };
    minima.enumerate().map(with).collect()
}

// Budgets that laws have not seen.

/// How a budget was kept from the laws that predict it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ValidationKind {
    /// The laws are fitted to all other fitted budgets.
    LeaveOneOut,
    /// The laws are fitted to the smaller budgets.
    RollForward,
}

/// The errors of laws at a budget left out of their fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Validation {
    pub kind: ValidationKind,
    pub budget_flops: f64,
    /// The number of budgets fitted.
    pub n_fitted: usize,
    /// Predicted less measured loss by the log law, in nats.
    pub log_error: f64,
    /// The same by the floor law, with three budgets or more.
    pub floor_error: Option<f64>,
    /// Predicted over measured N, if N_nv and N_v are not separate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub params_ratio: Option<f64>,
    /// Predicted over measured N_nv.
    pub params_nonvocab_ratio: Option<f64>,
    /// Predicted over measured N_v, if several vocabularies were tried.
    pub params_vocab_ratio: Option<f64>,
    /// Predicted over measured D.
    pub tokens_ratio: f64,
}

/// Fewest budgets that laws are fitted to; the floor law needs one more.
const FEWEST: usize = 2;

/// Every fitted budget predicted from all the others, and every budget but the smallest two
/// predicted from the smaller ones.
pub(in crate::laws) fn validate(
    used: &[Minimum],
    grids: &[Grid],
    options: &FitOptions,
) -> Vec<Validation> {
    let has_vocab_law = n_vocabularies(grids) > 1;
    let is_total = options.parameters == Parameters::Total;
    // The errors at a budget of the laws fitted to `from`.
    let predicted = |kind, measured: &Minimum, from: &[Minimum]| {
        let laws = LawSet::through(from, grids, options).filter(|_| from.len() >= FEWEST)?;
        let at = measured.budget_flops;
        let off = |loss: f64| loss - measured.loss_normalised;
        let ratio = |law: &PowerLaw, measured: f64| law.value_at(at) / measured;
        let size = ratio(&laws.params_nonvocab, measured.params_nonvocab);
        let vocab = laws.params_vocab.as_ref().filter(|_| has_vocab_law);
        Some(Validation {
            kind,
            budget_flops: at,
            n_fitted: from.len(),
            log_error: off(laws.log.loss_at(at)),
            floor_error: laws.floor.as_ref().map(|law| off(law.loss_at(at, laws.reference))),
            params_ratio: is_total.then_some(size),
            params_nonvocab_ratio: (!is_total).then_some(size),
            params_vocab_ratio: vocab.map(|law| ratio(law, measured.params_vocab)),
            tokens_ratio: ratio(&laws.tokens, measured.tokens),
        })
    };
    let left_out = used.iter().filter_map(|measured| {
        let others = used.iter().filter(|m| m.budget_flops != measured.budget_flops);
        let others: Vec<Minimum> = others.cloned().collect();
        predicted(ValidationKind::LeaveOneOut, measured, &others)
    });
    let rolled = (FEWEST..used.len())
        .filter_map(|i| predicted(ValidationKind::RollForward, &used[i], &used[..i]));
    left_out.chain(rolled).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::file::Laws;
    use crate::laws::fit::fit;
    use crate::laws::simulated::{SWEEP, Simulated};

    fn laws(sweep: Simulated) -> Laws {
        let options = FitOptions { bootstrap: 0, ..FitOptions::default() };
        fit(&sweep.points(), &options).unwrap()
    }

    fn of(laws: &Laws, kind: ValidationKind) -> Vec<&Validation> {
        laws.validation.iter().filter(|row| row.kind == kind).collect()
    }

    #[test]
    fn the_last_step_forward_is_the_held_out_budget() {
        let laws = laws(SWEEP);
        let rolled = of(&laws, ValidationKind::RollForward);
        let budgets: Vec<f64> = rolled.iter().map(|row| row.budget_flops).collect();
        assert_eq!(budgets, [1e16, 3e16, 1e17]);
        assert_eq!(rolled.iter().map(|row| row.n_fitted).collect::<Vec<_>>(), [2, 3, 4]);
        let last = rolled[2];
        assert_eq!(Some(last.log_error), laws.loss.log.as_ref().unwrap().held_out_error);
        assert_eq!(last.floor_error, laws.loss.floor.as_ref().unwrap().held_out_error);
        assert!(rolled[0].floor_error.is_none() && rolled[1].floor_error.is_some());
    }

    #[test]
    fn every_fitted_budget_is_left_out_once_and_predicted_well() {
        let laws = laws(SWEEP);
        let left_out = of(&laws, ValidationKind::LeaveOneOut);
        let budgets: Vec<f64> = left_out.iter().map(|row| row.budget_flops).collect();
        assert_eq!(budgets, laws.fitted_budgets);
        for row in left_out {
            assert!((row.params_nonvocab_ratio.unwrap() - 1.0).abs() < 0.05, "{row:?}");
            assert!((row.tokens_ratio - 1.0).abs() < 0.05, "{row:?}");
            assert!(row.log_error.abs() < 0.15, "{row:?}");
        }
    }

    #[test]
    fn two_budgets_leave_nothing_to_validate() {
        assert_eq!(laws(Simulated { budgets: &[1e15, 1e16], ..SWEEP }).validation, []);
    }
}
