//! Moves runs planned by one FLOP rule to equal FLOPs by another.
//!
//! A sweep is planned by one rule. By another rule the runs of a budget have unequal FLOPs, and a curve through them
//! does not have equal compute. So each run is moved along its cell: for one model and vocabulary the loss is a
//! function of ln C, known at the budgets of the cell. A run at ln C with loss L gets the loss L + f(C') − f(C) in
//! the slice at ln C', where f is the parabola through the cell's means at its budget and the neighbouring ones, or
//! the line through two.
//!
//! A slice lies at the geometric mean of the FLOPs of its budget's runs by the other rule.

use crate::laws::input::budget::Budget;
use crate::laws::input::{Cell, FitError, IsoFlopPoint, cells, group_budgets, is_same_budget};
use crate::laws::maths::stats::geometric_mean;

/// Steps to the neighbouring budget by which a cell is carried on beyond the budgets that it has.
const BEYOND: f64 = 0.5;

/// Distance in ln C below which two levels are one but for rounding.
const SAME: f64 = 1e-9;

/// The slices of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Slices {
    /// Each run in its slice, in the table's order; `None` if its cell does not reach so far.
    pub points: Vec<Option<IsoFlopPoint>>,
    /// Each declared budget, and the FLOPs of its slice.
    pub levels: Vec<(f64, f64)>,
}

impl Slices {
    /// The FLOPs of a declared budget's slice.
    pub fn level_of(&self, budget_flops: f64) -> Option<f64> {
        let own = self.levels.iter().find(|(declared, _)| is_same_budget(*declared, budget_flops));
        own.map(|(_, level)| *level)
    }
}

/// Moves runs to equal FLOPs by the rule that [`IsoFlopPoint::flops`] was counted by; all of them saw as much
/// of the data ([`of_largest_share`](crate::laws::input::of_largest_share)).
///
/// # Errors
/// As [`group_budgets`].
pub fn slices(points: &[IsoFlopPoint]) -> Result<Slices, FitError> {
    let budgets = group_budgets(points)?;
    let level = |budget: &Budget| geometric_mean(budget.points.iter().map(|point| point.flops));
    let levels: Vec<f64> = budgets.iter().map(level).collect();
    let grids: Vec<Vec<Cell>> = budgets.iter().map(|budget| cells(&budget.points)).collect();
    let moved = |point: &IsoFlopPoint| {
        let own = |budget: &Budget| is_same_budget(budget.budget_flops, point.budget_flops);
        let budget = budgets.iter().position(own)?;
        at(point, levels[budget], budget, &grids)
    };
    let points = points.iter().map(moved).collect();
    let declared = budgets.iter().map(|budget| budget.budget_flops);
    Ok(Slices { points, levels: declared.zip(levels.iter().copied()).collect() })
}

/// A run at the level of its budget's slice.
fn at(
    point: &IsoFlopPoint,
    flops: f64,
    budget: usize,
    grids: &[Vec<Cell>],
) -> Option<IsoFlopPoint> {
    let is_own = |cell: &&Cell| {
        cell.params_nonvocab == point.params_nonvocab
            && cell.params_vocab == point.params_vocab
            && cell.n_vocab == point.n_vocab
    };
    let mean = |cell: &Cell| Mean { ln_flops: cell.flops.ln(), loss: cell.loss };
    let of = |budget: usize| grids.get(budget)?.iter().find(is_own).map(mean);
    let (own, before, after) = (of(budget)?, budget.checked_sub(1).and_then(of), of(budget + 1));
    let near: Vec<Mean> = [before, Some(own), after].into_iter().flatten().collect();
    let (from, to) = (point.flops.ln(), flops.ln());
    reaches(own, before, after, to).then(|| IsoFlopPoint {
        budget_flops: flops,
        flops,
        // At one shape a token costs the same.
        tokens: point.tokens * flops / point.flops,
        loss: point.loss + through(&near, to) - through(&near, from),
        ..point.clone()
    })
}

/// The mean of a cell's runs at one budget.
#[derive(Clone, Copy, Debug)]
struct Mean {
    ln_flops: f64,
    loss: f64,
}

/// Whether a level lies among a cell's neighbouring budgets, or beyond the last by half a step at most.
fn reaches(own: Mean, before: Option<Mean>, after: Option<Mean>, level: f64) -> bool {
    let step = |a: Mean, b: Mean| b.ln_flops - a.ln_flops;
    let (least, most) = match (before, after) {
        (Some(before), Some(after)) => (before.ln_flops, after.ln_flops),
        (Some(before), None) => (before.ln_flops, own.ln_flops + BEYOND * step(before, own)),
        (None, Some(after)) => (own.ln_flops - BEYOND * step(own, after), after.ln_flops),
        (None, None) => (own.ln_flops, own.ln_flops),
    };
    (least - SAME..=most + SAME).contains(&level)
}

/// The polynomial through all of them at `x` (Lagrange).
fn through(means: &[Mean], x: f64) -> f64 {
    let share = |i: usize| -> f64 {
        let others = means.iter().enumerate().filter(|(j, _)| *j != i);
        let factor = |(_, other): (usize, &Mean)| {
            (x - other.ln_flops) / (means[i].ln_flops - other.ln_flops)
        };
        others.map(factor).product()
    };
    means.iter().enumerate().map(|(i, mean)| mean.loss * share(i)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::simulated::{SURFACE, point};

    const BUDGETS: [f64; 5] = [1e15, 2e15, 4e15, 8e15, 1.6e16];
    const SIZES: [f64; 7] = [2e5, 4e5, 8e5, 1.6e6, 3.2e6, 6.4e6, 1.28e7];

    /// The other rule: small models cost up to twice as much as by 6 N D.
    fn factor(nonvocab: f64) -> f64 {
        1.0 + 1.0 / (1.0 + nonvocab / 1e6)
    }

    /// Runs that spend their budgets by 6 N D, with `flops` by the other rule.
    fn planned() -> Vec<IsoFlopPoint> {
        let run = |budget: f64, nonvocab: f64| {
            let vocab = 4e5;
            let tokens = budget / (6.0 * (nonvocab + vocab));
            let loss = SURFACE.loss(nonvocab, vocab, tokens);
            let flops = budget * factor(nonvocab);
            IsoFlopPoint { budget_flops: budget, flops, tokens, ..point(nonvocab, vocab, loss, 0) }
        };
        BUDGETS.iter().flat_map(|budget| SIZES.map(|size| run(*budget, size))).collect()
    }

    #[test]
    fn a_run_has_the_loss_that_it_would_have_had_at_the_slice() {
        let Slices { points, levels } = slices(&planned()).unwrap();
        assert_eq!(levels.iter().map(|(budget, _)| *budget).collect::<Vec<_>>(), BUDGETS);
        let mut worst: [f64; 2] = [0.0; 2];
        for (run, moved) in planned().iter().zip(&points) {
            let moved = moved.as_ref().expect("no cell is moved by a step");
            let tokens =
                moved.flops / (6.0 * (run.params_nonvocab + 4e5) * factor(run.params_nonvocab));
            assert!((moved.tokens / tokens - 1.0).abs() < 1e-9);
            let truth = SURFACE.loss(run.params_nonvocab, 4e5, tokens);
            let at_end = run.budget_flops == BUDGETS[0] || run.budget_flops == BUDGETS[4];
            let worst = &mut worst[usize::from(at_end)];
            *worst = worst.max((moved.loss - truth).abs());
            assert!((run.loss - truth).abs() > 20.0 * (moved.loss - truth).abs() || at_end);
        }
        assert!(worst[0] < 1e-3 && worst[1] < 1e-2, "{worst:?}");
    }

    #[test]
    fn a_rule_that_counts_in_proportion_moves_nothing() {
        let mut runs = planned();
        runs.iter_mut().for_each(|run| run.flops = 1.7 * run.budget_flops);
        let Slices { points, levels } = slices(&runs).unwrap();
        for (run, moved) in runs.iter().zip(points) {
            let moved = moved.unwrap();
            assert!(
                (moved.loss - run.loss).abs() < 1e-12
                    && (moved.tokens / run.tokens - 1.0).abs() < 1e-9
            );
        }
        assert!(levels.iter().all(|(budget, level)| (level / budget - 1.7).abs() < 1e-9));
    }

    #[test]
    fn a_cell_at_one_budget_alone_is_left_out() {
        let mut runs = planned();
        let alone = IsoFlopPoint { params_nonvocab: 5e5, ..runs[0].clone() };
        runs.push(alone);
        assert_eq!(slices(&runs).unwrap().points.last().unwrap(), &None);
    }
}
