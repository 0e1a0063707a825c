//! The budgets that are fitted, and the one that is not.

use super::minima::{self, Grid};
use super::stats::distinct;
use super::{Budget, FitOptions, HeldOut, Minimum, RunNoise};
use crate::laws::MinimumMethod;

/// A table's budgets, gridded and parted once at the start of a fit: nothing after this looks at
/// single runs.
pub(super) struct Split {
    pub fitted: Vec<Grid>,
    pub held_out: Option<Grid>,
}

impl Split {
    pub fn new(budgets: &[Budget], held_out: Option<usize>) -> Self {
        let mut grids: Vec<Grid> = budgets.iter().filter_map(Grid::new).collect();
        let held_out = held_out.map(|index| grids.remove(index));
        Self { fitted: grids, held_out }
    }

    /// Every method asked for, and those that the choice of the laws' method needs, with the
    /// minima of the fitted budgets.
    pub fn minima_by_method(
        &self,
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
        methods
            .into_iter()
            .map(|method| (method, minima::of_grids(method, &self.fitted, scatter)))
            .collect()
    }

    /// The minimum measured at the held-out budget. The noise that its flags are judged by is
    /// pooled over all budgets, as for the others.
    pub fn held_out_minimum(
        &self,
        method: MinimumMethod,
        scatter: Option<RunNoise>,
    ) -> Option<HeldOut> {
        let grid = self.held_out.as_ref()?;
        let all: Vec<_> = self.fitted.iter().chain([grid]).cloned().collect();
        let minimum = minima::of_grids(method, &all, scatter).pop()?;
        Some(HeldOut { budget_flops: grid.budget_flops, minimum })
    }

    /// How many vocabularies the fitted budgets tried.
    pub fn n_vocabularies(&self) -> usize {
        let cells = self.fitted.iter().flat_map(|grid| &grid.cells);
        distinct(cells.map(|cell| cell.n_vocab)).len()
    }
}
