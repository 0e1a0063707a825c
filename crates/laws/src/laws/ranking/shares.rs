//! What laws are tested by: the budgets of each share of the data, with their minima.

use crate::laws::input::method::MinimumMethod;
use crate::laws::input::options::FitOptions;
use crate::laws::maths::stats::distinct;
use crate::laws::minima::grid::Grid;
use crate::laws::minima::of_grids;
use crate::laws::minima::run_noise::RunNoise;
use crate::laws::minima::select::{tell_laws, usable};
use crate::laws::minima::types::Minimum;

/// Fewest budgets that a law is fitted to before it is tested.
pub const FEWEST: usize = 3;

/// Runs that saw one share of the data.
///
/// Laws of minima are of one share and are tested within it; a joint law is of all shares and is tested in
/// each. Where a share is small its larger budgets repeat it as those do that the whole will be asked for.
pub(in crate::laws) struct OfShare {
    /// 1 for the largest.
    pub of_largest: f64,
    /// Of each budget, in the order of the rows; none where it has no such run.
    pub budgets: Vec<Option<OfBudget>>,
}

/// One budget's runs of a share.
pub(in crate::laws) struct OfBudget {
    pub grid: Grid,
    /// By the laws' method; none where it may not be used.
    pub minimum: Option<Minimum>,
}

impl OfShare {
    /// The minima that power laws through the first `n` budgets are fitted to; none where they are too few.
    pub fn fitted_minima(&self, n: usize) -> Option<Vec<Minimum>> {
        let minima = self.budgets[..n].iter().flatten().filter_map(|own| own.minimum.clone());
        let used: Vec<Minimum> = minima.collect();
        tell_laws(&used).then_some(used)
    }
}

/// The runs of each share of the data with their minima by a method where these may be used, the largest
/// share first; `own` are the minima of that one.
pub(in crate::laws) fn shares(
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
