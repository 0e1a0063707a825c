//! One budget's runs as a grid: cells averaged over seeds, and sizes at their best vocabulary.

use super::point::IsoFlopPoint;
use std::cmp::Ordering;
use std::collections::BTreeMap;

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
    /// How many runs of equal weight the mean is worth, (Σw)²/Σw²: with runs of standard deviation
    /// σ that of `loss` is σ/√`runs`.
    pub runs: f64,
    /// Sum of the runs' squared distances from the plain mean of those with the same tokenizer.
    pub spread: f64,
    /// Runs less tokenizers: the degrees of freedom of `spread`.
    pub dof: usize,
    /// Blocks of the model, where they are known.
    pub n_layer: Option<usize>,
    /// Distinct tokens of the training split, where they are known.
    pub unique_tokens: Option<f64>,
    /// What the runs saw of the training split, 1 being all.
    pub share: f64,
    /// Mean over the runs of the loss on each block of the test split, less the mean of all blocks; empty
    /// where some run does not know it.
    pub by_block: Vec<f64>,
}

impl Cell {
    /// ln D(N_nv + N_v): what a budget leaves nearly constant over its grid.
    pub fn ln_work(&self) -> f64 {
        self.tokens.ln() + (self.params_nonvocab + self.params_vocab).ln()
    }

    /// Passes over the distinct tokens, where they are known.
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

/// ln N_v at the vertex of the parabola through the best vocabulary and its two neighbours; the
/// best vocabulary itself where it has no neighbour on one side.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::simulated::point;

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
