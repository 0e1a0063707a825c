//! Runs by declared budget, and one budget's runs as a grid: cells averaged over seeds, and sizes at their
//! best vocabulary.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use super::{FitError, IsoFlopPoint, Metric, Parameters};
use crate::laws::maths::stats::distinct;

/// Relative distance within which two declared budgets are one: they are written by people, so
/// nothing but rounding separates equal ones.
const SAME_BUDGET: f64 = 1e-9;

/// The runs of one declared budget.
#[derive(Clone, Debug, PartialEq)]
pub struct Budget<'a> {
    pub budget_flops: f64,
    /// The runs on the largest share of the data.
    pub points: Vec<&'a IsoFlopPoint>,
    /// The runs on smaller shares.
    pub smaller: Vec<&'a IsoFlopPoint>,
}

/// The budgets of a table, ascending; the rows of each in the table's order. A budget without a run that saw
/// as much of the data as any is left out.
///
/// # Errors
/// [`FitError::BadValue`] and [`FitError::BadLoss`] name the first run with a value that no law can use;
/// N_v and V are among them, so the points must be [`Parameters::Split`].
pub fn group_budgets(points: &[IsoFlopPoint]) -> Result<Vec<Budget<'_>>, FitError> {
    group_checked(points, Parameters::Split)
}

/// [`group_budgets`] for either kind of table.
pub(in crate::laws) fn group_checked<'a>(
    points: &'a [IsoFlopPoint],
    parameters: Parameters,
) -> Result<Vec<Budget<'a>>, FitError> {
    points.iter().try_for_each(|point| point.check(parameters))?;
    let mut rows: Vec<&'a IsoFlopPoint> = points.iter().collect();
    rows.sort_by(|a, b| a.budget_flops.total_cmp(&b.budget_flops));
    let groups = rows.chunk_by(|a, b| is_same_budget(a.budget_flops, b.budget_flops));
    let whole = largest_share(points);
    let budget = |group: &[&'a IsoFlopPoint]| {
        let (points, smaller) = group.iter().partition(|point| point.share() == whole);
        Budget { budget_flops: group[0].budget_flops, points, smaller }
    };
    Ok(groups.map(budget).filter(|budget| !budget.points.is_empty()).collect())
}

/// The runs of a table that saw as much of the data as any of it.
pub fn of_largest_share(points: &[IsoFlopPoint]) -> Vec<IsoFlopPoint> {
    let whole = largest_share(points);
    points.iter().filter(|point| point.share() == whole).cloned().collect()
}

/// The most that a run of a table saw of the data.
fn largest_share(points: &[IsoFlopPoint]) -> f64 {
    points.iter().map(IsoFlopPoint::share).fold(0.0, f64::max)
}

/// Whether two declared budgets are the same but for rounding.
pub(in crate::laws) fn is_same_budget(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME_BUDGET * a.abs().max(b.abs())
}

/// The budgets that are left out since no run of theirs saw as much of the data as others.
pub(in crate::laws) fn lost_shares(points: &[IsoFlopPoint], budgets: &[Budget]) -> Vec<f64> {
    let known = |c: f64| budgets.iter().any(|own| is_same_budget(own.budget_flops, c));
    distinct(points.iter().map(|p| p.budget_flops).filter(|c| !known(*c)))
}

// The cells of a budget.

/// A model and a vocabulary at one budget, averaged over its runs by their weights.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::laws) struct Cell {
    pub params_nonvocab: f64,
    pub params_vocab: f64,
    pub n_vocab: f64,
    /// Geometric mean over the runs.
    pub tokens: f64,
    /// Geometric mean over the runs.
    pub flops: f64,
    /// Arithmetic mean over the runs.
    pub loss: f64,
    /// Whether the loss is L_u, in nats; the unit of any other is not known.
    pub in_nats: bool,
    /// The effective number of runs in the mean, (Σw)²/Σw²: if a run has standard deviation σ, `loss` has
    /// σ/√`runs`.
    pub runs: f64,
    /// Sum of the runs' squared distances from the plain mean of those with the same tokenizer.
    pub spread: f64,
    /// Runs less tokenizers: the degrees of freedom of `spread`.
    pub dof: usize,
    /// Layers of the model, if known.
    pub n_layer: Option<usize>,
    /// Distinct tokens of the training split, if known.
    pub unique_tokens: Option<f64>,
    /// The fraction of the training split used, 1 for all.
    pub share: f64,
    /// Mean loss of the runs on each block of the test split, minus the mean of all blocks; empty if some run lacks
    /// it.
    pub by_block: Vec<f64>,
}

impl Cell {
    /// ln D(N_nv + N_v), nearly constant over a budget's grid.
    pub fn ln_work(&self) -> f64 {
        self.tokens.ln() + (self.params_nonvocab + self.params_vocab).ln()
    }

    /// Passes over the distinct tokens, if known.
    pub fn epochs(&self) -> Option<f64> {
        Some(self.tokens / self.unique_tokens?)
    }

    /// Whether N_v is known; it is 0 in a table that gives N alone.
    pub fn has_vocabulary(&self) -> bool {
        self.params_vocab > 0.0
    }

    /// ln d = ln N_v/V.
    pub fn ln_width(&self) -> f64 {
        (self.params_vocab / self.n_vocab).ln()
    }
}

/// One model size at one budget.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::laws) struct Size {
    /// The cell of the best vocabulary.
    pub best: Cell,
    /// ln N_v of the optimum, between the vocabularies tried; −∞ where N_v is 0.
    pub ln_vocab: f64,
    /// The best vocabulary is the smallest or the largest of several tried.
    pub at_edge: bool,
}

/// The cells of one budget, by N_nv and then N_v.
pub(in crate::laws) fn cells(points: &[&IsoFlopPoint]) -> Vec<Cell> {
    let mut rows = points.to_vec();
    rows.sort_by(|a, b| compare(&key(a), &key(b)));
    rows.chunk_by(|a, b| key(a) == key(b)).map(mean).collect()
}

fn key(p: &IsoFlopPoint) -> [f64; 3] {
    [p.params_nonvocab, p.params_vocab, p.n_vocab]
}

/// Lexicographic order of numbers.
pub(in crate::laws) fn compare(a: &[f64], b: &[f64]) -> Ordering {
    let orders = a.iter().zip(b).map(|(a, b)| a.total_cmp(b));
    orders.fold(Ordering::Equal, Ordering::then)
}

fn mean(runs: &[&IsoFlopPoint]) -> Cell {
    let total: f64 = runs.iter().map(|run| run.weight).sum();
    let squares: f64 = runs.iter().map(|run| run.weight.powi(2)).sum();
    let over = |value: fn(&IsoFlopPoint) -> f64| {
        runs.iter().map(|run| run.weight * value(run)).sum::<f64>() / total
    };
    let (spread, dof) = spread(runs);
    Cell {
        params_nonvocab: runs[0].params_nonvocab,
        params_vocab: runs[0].params_vocab,
        n_vocab: runs[0].n_vocab,
        tokens: over(|run| run.tokens.ln()).exp(),
        flops: over(|run| run.flops.ln()).exp(),
        loss: over(|run| run.loss),
        in_nats: runs[0].metric == Metric::default(),
        runs: total.powi(2) / squares,
        spread,
        dof,
        n_layer: runs[0].about.n_layer,
        unique_tokens: runs[0].about.unique_tokens,
        share: runs[0].share(),
        by_block: by_block(runs, total),
    }
}

fn by_block(runs: &[&IsoFlopPoint], total: f64) -> Vec<f64> {
    let n = runs[0].about.by_block.len();
    if runs.iter().any(|run| run.about.by_block.len() != n) {
        return Vec::new();
    }
    let of =
        |block: usize| runs.iter().map(|run| run.weight * run.about.by_block[block]).sum::<f64>();
    (0..n).map(|block| of(block) / total).collect()
}

/// The runs' squared distances from the mean of those with the same tokenizer, and how many of them
/// are free.
fn spread(runs: &[&IsoFlopPoint]) -> (f64, usize) {
    let mut of_tokenizers: BTreeMap<Option<&str>, Vec<f64>> = BTreeMap::new();
    for run in runs {
        of_tokenizers.entry(run.about.tokenizer.as_deref()).or_default().push(run.loss);
    }
    let squares = |losses: &Vec<f64>| {
        let mean = losses.iter().sum::<f64>() / losses.len() as f64;
        losses.iter().map(|loss| (loss - mean).powi(2)).sum::<f64>()
    };
    (of_tokenizers.values().map(squares).sum(), runs.len() - of_tokenizers.len())
}

/// The sizes of a grid, ascending in N_nv, from its [`cells`].
pub(in crate::laws) fn sizes(cells: &[Cell]) -> Vec<Size> {
    cells.chunk_by(|a, b| a.params_nonvocab == b.params_nonvocab).map(size).collect()
}

fn size(cells: &[Cell]) -> Size {
    let best = best_index(cells);
    let at_edge = cells.len() > 1 && (best == 0 || best + 1 == cells.len());
    Size { best: cells[best].clone(), ln_vocab: vocabulary_optimum(cells, best), at_edge }
}

/// The cell of the lowest loss; the first of equals, which is the smallest.
pub(in crate::laws) fn best_index(cells: &[Cell]) -> usize {
    let by_loss = |a: &usize, b: &usize| cells[*a].loss.total_cmp(&cells[*b].loss);
    (0..cells.len()).min_by(by_loss).expect("a grid has a cell")
}

/// ln N_v at the vertex of the parabola through the best vocabulary and its two neighbours; the best vocabulary
/// itself if it has no neighbour on one side.
///
/// Since the middle of the three is the lowest, the vertex lies between the neighbours' midpoints:
/// it moves by less than the grid's step, and takes most of the grid's rounding out of N_v.
fn vocabulary_optimum(cells: &[Cell], best: usize) -> f64 {
    let x = |i: usize| cells[i].params_vocab.ln();
    if best == 0 || best + 1 == cells.len() {
        return x(best);
    }
    let (left, right) = (x(best) - x(best - 1), x(best + 1) - x(best));
    let (rise_left, rise_right) =
        (cells[best - 1].loss - cells[best].loss, cells[best + 1].loss - cells[best].loss);
    let curvature = rise_left * right + rise_right * left;
    if curvature <= 0.0 || left <= 0.0 || right <= 0.0 {
        return x(best);
    }
    x(best) + 0.5 * (rise_left * right.powi(2) - rise_right * left.powi(2)) / curvature
}

/// The number of (cell, tokenizer, seed) with several rows, and the first repeat.
///
/// Repeats of one seed are averaged like seeds, which is wrong if they differ in a setting that the table does not
/// show, such as the learning rate.
pub(in crate::laws) fn repeats(points: &[IsoFlopPoint]) -> Option<(usize, &str)> {
    let mut rows: Vec<_> = points.iter().collect();
    let place = |p: &IsoFlopPoint| {
        [p.budget_flops, p.params_nonvocab, p.params_vocab, p.n_vocab, p.share()]
    };
    let own = |p: &IsoFlopPoint| (p.seed, p.about.tokenizer.clone());
    rows.sort_by(|a, b| compare(&place(a), &place(b)).then_with(|| own(a).cmp(&own(b))));
    let groups = rows.chunk_by(|a, b| place(a) == place(b) && own(a) == own(b));
    let repeated: Vec<_> = groups.filter(|g| g.len() > 1).map(|g| g[1].run_id.as_str()).collect();
    Some((repeated.len(), *repeated.first()?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::input::{RunFacts, *};
    use crate::laws::simulated::point;

    #[test]
    fn budgets_of_smaller_shares_alone_are_named() {
        let on = |share, budget_flops| IsoFlopPoint {
            about: RunFacts { share: Some(share), ..RunFacts::default() },
            budget_flops,
            ..point(1e6, 1e4, -1.0, 0)
        };
        let points = [on(1.0, 1e9), on(0.5, 1e9), on(0.5, 2e9)];
        let lost = |points: &[IsoFlopPoint]| lost_shares(points, &group_budgets(points).unwrap());
        assert_eq!(lost_shares(&points, &group_budgets(&points).unwrap()), [2e9]);
        assert!(lost(&points[..2]).is_empty());
    }

    #[test]
    fn seeds_are_averaged_before_anything_else() {
        let runs = [point(1e6, 1e4, -1.0, 0), point(1e6, 1e4, -2.0, 1), point(2e6, 1e4, -3.0, 0)];
        let cells = cells(&runs.iter().collect::<Vec<_>>());
        assert_eq!(cells.iter().map(|c| c.loss).collect::<Vec<_>>(), [-1.5, -3.0]);
    }

    #[test]
    fn a_run_of_double_weight_counts_as_two_in_its_cell() {
        let run = |loss, weight| IsoFlopPoint { weight, ..point(1e6, 1e4, loss, 0) };
        let mean = |runs: &[IsoFlopPoint]| cells(&runs.iter().collect::<Vec<_>>())[0].clone();
        let weighted = mean(&[run(-1.0, 2.0), run(-4.0, 1.0)]);
        let repeated = mean(&[run(-1.0, 1.0), run(-1.0, 1.0), run(-4.0, 1.0)]);
        assert_eq!((weighted.loss, repeated.loss), (-2.0, -2.0));
        assert!((weighted.runs - 9.0 / 5.0).abs() < 1e-15 && repeated.runs == 3.0);
    }

    #[test]
    fn the_vocabulary_optimum_is_exact_for_a_quadratic_on_an_uneven_grid() {
        let truth = 9.3;
        let loss = |n_v: f64| 0.1 * (n_v.ln() - truth).powi(2) - 2.0;
        let runs = [2e3, 8e3, 2e4, 1e5].map(|n_v| point(1e6, n_v, loss(n_v), 0));
        let sizes = sizes(&cells(&runs.iter().collect::<Vec<_>>()));
        assert_eq!(sizes.len(), 1);
        assert!((sizes[0].ln_vocab - truth).abs() < 1e-12, "{}", sizes[0].ln_vocab);
    }
}
