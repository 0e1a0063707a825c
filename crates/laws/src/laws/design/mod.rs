//! Which runs of a grid to train next: those that sharpen a prediction most for their FLOPs.
//!
//! The cheapest two budgets are trained whole. Each further budget begins with a window of its grid
//! around the optimum that the joint law through all runs so far puts there, since the minimum of a
//! budget is read off a curve. Then windows grow cell by cell.
//!
//! What is believed of the losses is normal: the coefficients of the joint law, and beside it a walk in
//! ln C, for no law holds alike at every budget. A run tells of both, with its own noise. By how much
//! a cell would lower the variance of the loss that is predicted has a closed form, which needs no
//! training (c-optimal design, Elfving 1952). Cells are taken by that gain per FLOP.
//!
//! | step | file |
//! | --- | --- |
//! | a budget's window and cells | `open_grid` |
//! | what a cell would tell | `known`, on `belief` |

pub(in crate::laws) mod advice;
pub(in crate::laws) mod advice_grid;
pub(in crate::laws) mod belief;
pub(in crate::laws) mod known;
pub(in crate::laws) mod open_grid;
pub(in crate::laws) mod open_run;

use known::Known;

pub use open_run::OpenRun;

use crate::laws::input::point::IsoFlopPoint;
use crate::laws::maths::stats::distinct;

/// Budgets that are trained whole before anything is known.
const FEWEST_BUDGETS: usize = 2;

/// What runs are chosen for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DesignGoal {
    /// The budget whose loss is predicted.
    pub budget_flops: f64,
    /// FLOPs to spend at least, where windows grow.
    pub spend_flops: f64,
}

/// The runs to train next, by their places in `open`, after those of `points` were trained.
pub fn next_runs(points: &[IsoFlopPoint], open: &[OpenRun], goal: DesignGoal) -> Vec<usize> {
    match Known::of(points, open, goal.budget_flops) {
        Some(known) => known.choose(points, open, goal.spend_flops),
        None => cheapest(points, open),
    }
}

/// Whole budgets, the cheapest first: two where none is trained yet, else one.
fn cheapest(points: &[IsoFlopPoint], open: &[OpenRun]) -> Vec<usize> {
    let budgets = distinct(open.iter().map(|run| run.budget_flops));
    let count = if points.is_empty() { FEWEST_BUDGETS } else { 1 };
    let first = &budgets[..count.min(budgets.len())];
    (0..open.len()).filter(|i| first.contains(&open[*i].budget_flops)).collect()
}

#[cfg(test)]
mod tests;
