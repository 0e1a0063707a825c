//! Which budgets and which minima the laws are fitted to.

use super::grid::Grid;
use super::run_noise::RunNoise;
use super::types::Minimum;
use crate::laws::input::budget::{Budget, is_same_budget};
use crate::laws::input::error::FitError;
use crate::laws::input::method::MinimumMethod;
use crate::laws::input::options::{FitOptions, HoldOut};
use crate::laws::maths::stats::distinct;
use crate::laws::minima;

/// Minima that laws go through, at least.
const ENOUGH: usize = 3;
/// The kinds of minimum, the first to be preferred.
pub(in crate::laws) const PREFERRED: [MinimumMethod; 5] = [
    MinimumMethod::Parabola,
    MinimumMethod::Akima,
    MinimumMethod::Surface,
    MinimumMethod::Cubic,
    MinimumMethod::Argmin,
];

/// The index of the held-out budget, if any; by default there is none of two.
///
/// # Errors
/// [`FitError::TooFewBudgets`] and [`FitError::HoldOutAbsent`].
pub(in crate::laws) fn hold_out(
    budgets: &[Budget],
    wanted: HoldOut,
) -> Result<Option<usize>, FitError> {
    if budgets.len() < 2 {
        return Err(FitError::TooFewBudgets { found: budgets.len() });
    }
    match wanted {
        HoldOut::None => Ok(None),
        HoldOut::LargestBudget => Ok((budgets.len() > 2).then_some(budgets.len() - 1)),
        HoldOut::Budget(asked) => held_out_at(budgets, asked).map(Some),
    }
}

fn held_out_at(budgets: &[Budget], asked: f64) -> Result<usize, FitError> {
    let same = |b: &Budget| is_same_budget(b.budget_flops, asked);
    let Some(index) = budgets.iter().position(same) else {
        let budgets = budgets.iter().map(|b| b.budget_flops).collect();
        return Err(FitError::HoldOutAbsent { asked, budgets });
    };
    if budgets.len() == 2 {
        return Err(FitError::TooFewBudgets { found: 1 });
    }
    Ok(index)
}

/// The method the laws are fitted to, unless one is asked for: the first kind of which three minima have no
/// flag, else the first of which three may be used. The best run alone, which is as coarse as the grid, is
/// the last of them.
pub(in crate::laws) fn law_method(
    per_method: &[(MinimumMethod, Vec<Minimum>)],
    options: &FitOptions,
) -> MinimumMethod {
    if let Some(method) = options.law_method {
        return method;
    }
    let minima = |method| per_method.iter().find(|(m, _)| *m == method).map(|(_, minima)| minima);
    let count = |method, is: fn(&Minimum) -> bool| {
        minima(method).map_or(0, |minima| minima.iter().filter(|m| is(m)).count())
    };
    // Best runs are cells of the grid, and no curve is so doubtful that they would be nearer.
    let [curves @ .., best_run] = PREFERRED;
    let is_curve =
        |is: fn(&Minimum) -> bool| curves.into_iter().find(|method| count(*method, is) >= ENOUGH);
    let of_runs = || Some(best_run).filter(|method| count(*method, Minimum::is_usable) >= ENOUGH);
    let method = is_curve(|m| m.trusted).or_else(|| is_curve(Minimum::is_usable));
    method.or_else(of_runs).unwrap_or(PREFERRED[0])
}

/// The minima that a fit may use: those without a flag, or, where fewer than three are, those in doubt
/// too; all where flagged ones are kept.
pub(in crate::laws) fn usable(minima: &[Minimum], options: &FitOptions) -> Vec<Minimum> {
    let trusted = minima.iter().filter(|m| m.trusted).count();
    let use_it =
        |m: &&Minimum| options.keep_flagged || m.trusted || (trusted < ENOUGH && m.is_usable());
    minima.iter().filter(use_it).cloned().collect()
}

/// Whether minima tell an exponent: three that differ, since any line goes through two, and two best runs of
/// one cell of the grid have a slope of 0 by the grid alone.
pub(in crate::laws) fn tell_laws(used: &[Minimum]) -> bool {
    let differ = |of: fn(&Minimum) -> f64| distinct(used.iter().map(of)).len();
    let of_runs = |m: &Minimum| m.method == MinimumMethod::Argmin || m.is_best_run_instead();
    let sizes = !used.iter().any(of_runs) || differ(|m| m.params_nonvocab) >= ENOUGH;
    used.len() >= ENOUGH && sizes && differ(|m| m.loss_normalised) > 1
}

/// The minima by each method asked for; without a method for the laws, the two that it may fall on too.
pub(in crate::laws) fn minima_by_method(
    grids: &[Grid],
    options: &FitOptions,
    scatter: Option<RunNoise>,
) -> Vec<(MinimumMethod, Vec<Minimum>)> {
    let mut methods = options.methods.clone();
    match options.law_method {
        Some(method) => methods.push(method),
        None => methods.extend([MinimumMethod::Argmin, MinimumMethod::Parabola]),
    }
    methods.sort();
    methods.dedup();
    methods.into_iter().map(|method| (method, minima::of_grids(method, grids, scatter))).collect()
}

/// How many vocabularies were tried.
pub(in crate::laws) fn n_vocabularies(grids: &[Grid]) -> usize {
    distinct(grids.iter().flat_map(|grid| &grid.cells).map(|cell| cell.n_vocab)).len()
}
