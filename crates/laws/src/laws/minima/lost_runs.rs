//! Cells that have lost some of their runs.

use super::grid::Grid;
use crate::laws::input::cell::Cell;

/// The cells that are the best of their size and have fewer runs than is usual at their budget, with it.
pub(in crate::laws) fn lost_runs<'a>(
    grids: impl Iterator<Item = &'a Grid>,
) -> Vec<(f64, &'a Cell)> {
    grids.flat_map(|grid| lost(grid).map(|cell| (grid.budget_flops, cell))).collect()
}

fn lost(grid: &Grid) -> impl Iterator<Item = &Cell> {
    let mut runs: Vec<f64> = grid.cells.iter().map(|cell| cell.runs).collect();
    runs.sort_by(f64::total_cmp);
    let usual = runs[runs.len() / 2];
    grid.sizes.iter().map(|size| &size.best).filter(move |cell| cell.runs < usual - 0.5)
}
