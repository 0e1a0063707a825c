//! The budgets of a table, gridded once.

use super::minima::{self, Grid};
use super::stats::distinct;
use super::{Budget, FitOptions, Minimum, RunNoise};
use crate::laws::MinimumMethod;

/// A table's budgets, gridded once at the start of a fit: nothing after this looks at single runs.
pub(super) struct Split {
    /// By budget, ascending.
    pub fitted: Vec<Grid>,
}

impl Split {
    pub fn new(budgets: &[Budget]) -> Self {
        Self { fitted: budgets.iter().filter_map(Grid::new).collect() }
    }

    /// Every method asked for, and those that the choice of the laws' method needs, with the
    /// minima of the budgets.
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

    /// How many vocabularies were tried.
    pub fn n_vocabularies(&self) -> usize {
        let cells = self.fitted.iter().flat_map(|grid| &grid.cells);
        distinct(cells.map(|cell| cell.n_vocab)).len()
    }
}
