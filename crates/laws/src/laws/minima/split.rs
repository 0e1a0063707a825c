//! The budgets of a table, gridded once.

use super::grid::Grid;
use super::run_noise::RunNoise;
use super::types::Minimum;
use crate::laws::input::budget::Budget;
use crate::laws::input::method::MinimumMethod;
use crate::laws::input::options::FitOptions;
use crate::laws::maths::stats::distinct;
use crate::laws::minima;

/// A table's budgets, gridded once at the start of a fit: nothing after this looks at single runs.
pub(in crate::laws) struct Split {
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
