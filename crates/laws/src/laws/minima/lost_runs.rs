//! Cells that have lost some of their runs.

use super::grid::Grid;
use crate::laws::words::text::count;

/// Cells that a sentence names, at most.
const NAMED: usize = 3;

/// Where a cell that is the best of its size has fewer runs than is usual at its budget.
pub(in crate::laws) fn of_lost_runs<'a>(grids: impl Iterator<Item = &'a Grid>) -> Option<String> {
    let lost: Vec<String> = grids.flat_map(lost).collect();
    let more = match lost.len().saturating_sub(NAMED) {
        0 => String::new(),
        n => format!("; {n} more"),
    };
    let named = lost[..lost.len().min(NAMED)].join("; ");
    (!lost.is_empty()).then(|| {
        format!(
            "{} cell(s) that are the best of their size have fewer runs than the others of their \
             budget ({named}{more}). If the runs that are missing diverged, the mean is that of the \
             luckier ones: lower the rate, or train those cells again with other seeds.",
            lost.len()
        )
    })
}

fn lost(grid: &Grid) -> Vec<String> {
    let mut runs: Vec<f64> = grid.cells.iter().map(|cell| cell.runs).collect();
    runs.sort_by(f64::total_cmp);
    let usual = runs[runs.len() / 2];
    let best = grid.sizes.iter().map(|size| &size.best);
    let fewer = best.filter(|cell| cell.runs < usual - 0.5);
    let name = |n_vocab: f64| {
        if n_vocab > 0.0 { format!(", V = {n_vocab}") } else { String::new() }
    };
    fewer
        .map(|cell| {
            let (budget, size) = (count(grid.budget_flops), count(cell.params_nonvocab));
            format!("{budget} FLOPs, N = {size}{}", name(cell.n_vocab))
        })
        .collect()
}
