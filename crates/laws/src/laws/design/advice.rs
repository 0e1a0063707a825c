//! What to run next, from what the sweep leaves open.
//!
//! Doubtful minima are mended where they are: sizes or vocabularies beyond an edge, sizes where there
//! are too few, seeds where a curve is flat within its noise. Beyond the sweep there is always one
//! further budget, whose grid is centred where the laws put its optimum.

use super::advice_grid::{Spacing, around, beyond, median_ratio};
use crate::laws::file::advice::{Advice, AdviceKind};
use crate::laws::file::laws::Laws;
use crate::laws::input::method::MinimumMethod;
use crate::laws::input::point::Parameters;
use crate::laws::lines::power::power_law;
use crate::laws::lines::types::PowerLaw;
use crate::laws::maths::stats::geometric_mean;
use crate::laws::minima::grid::Grid;
use crate::laws::minima::types::{Minimum, MinimumFlag};
use crate::laws::say::advice::Why;

/// An exponent whose 95 % interval is wider than this wants another budget.
const WIDE: f64 = 0.2;
/// Levels added beyond an edge.
const BEYOND: usize = 2;
/// Vocabularies, or sizes, that a new size, or vocabulary, is run with: the best and its neighbours.
const NEIGHBOURS: usize = 3;
/// Levels that any curve can be drawn through and tested.
const ENOUGH_SIZES: usize = 5;

/// Advice for every flagged minimum of the laws' method, and for the next budget.
pub(in crate::laws) fn advise(laws: &Laws, grids: &[Grid]) -> Vec<Advice> {
    let spacing = Spacing::of(grids);
    let own = |grid: &Grid| laws.own_minima().find(|m| m.budget_flops == grid.budget_flops);
    let mending = grids.iter().filter_map(|grid| Some(mend(grid, own(grid)?, &spacing))).flatten();
    mending.chain(next_budget(laws, grids, &spacing)).collect()
}

/// What would clear a minimum's flags.
fn mend(grid: &Grid, minimum: &Minimum, spacing: &Spacing) -> Vec<Advice> {
    let flags = &minimum.flags;
    // More levels are the cure of both, and the edge is only known where there are enough.
    let few = flags.contains(&MinimumFlag::FewLevels);
    let advice = |flag: &MinimumFlag| match flag {
        MinimumFlag::FewLevels => few_levels(grid, minimum.method, spacing),
        MinimumFlag::NotBracketed if !few => Some(beyond_sizes(grid, spacing)),
        MinimumFlag::VocabNotBracketed => Some(beyond_vocabularies(grid, spacing)),
        MinimumFlag::WeakCurvature => Some(more_seeds(grid, Why::Flat)),
        MinimumFlag::NotConvex => Some(more_seeds(grid, Why::NoMinimum)),
        MinimumFlag::Gap => between_sizes(grid, minimum),
        MinimumFlag::EdgeVocab if !flags.contains(&MinimumFlag::VocabNotBracketed) => {
            Some(beyond_vocabularies(grid, spacing))
        }
        MinimumFlag::EdgeVocab | MinimumFlag::LackOfFit | MinimumFlag::BelowRuns => None,
        MinimumFlag::NotBracketed | MinimumFlag::DepthChange => None,
    };
    flags.iter().filter_map(advice).collect()
}

/// Sizes past the end that the best run is nearer to.
fn beyond_sizes(grid: &Grid, spacing: &Spacing) -> Advice {
    let sizes = grid.size_levels();
    let place = sizes.iter().filter(|n| **n < grid.best().params_nonvocab).count();
    let upwards = 2 * place + 1 > sizes.len();
    Advice {
        params_nonvocab: beyond(&sizes, upwards, spacing.size_ratio(&sizes), BEYOND),
        n_vocab: nearest(&grid.vocabularies(), grid.best().n_vocab),
        why: Why::SizeAtEdge { largest: upwards }.phrase(),
        ..Advice::at(AdviceKind::AddSizes, grid.budget_flops)
    }
    .costed(grid.runs_per_cell())
}

/// A size in the middle of the gap that a minimum lies in.
fn between_sizes(grid: &Grid, minimum: &Minimum) -> Option<Advice> {
    let sizes = grid.size_levels();
    let above = sizes.partition_point(|n| *n <= minimum.params_nonvocab);
    let (left, right) = (sizes.get(above.checked_sub(1)?)?, sizes.get(above)?);
    let advice = Advice {
        params_nonvocab: vec![(left * right).sqrt()],
        n_vocab: nearest(&grid.vocabularies(), grid.best().n_vocab),
        why: Why::Gap(*left, *right).phrase(),
        ..Advice::at(AdviceKind::AddSizes, grid.budget_flops)
    };
    Some(advice.costed(grid.runs_per_cell()))
}

fn few_levels(grid: &Grid, method: MinimumMethod, spacing: &Spacing) -> Option<Advice> {
    let sizes = grid.size_levels();
    let missing = ENOUGH_SIZES.saturating_sub(sizes.len());
    if missing == 0 {
        return None;
    }
    let all = around(&sizes, spacing.size_ratio(&sizes), ENOUGH_SIZES);
    let advice = Advice {
        params_nonvocab: all.into_iter().filter(|n| !sizes.contains(n)).collect(),
        n_vocab: nearest(&grid.vocabularies(), grid.best().n_vocab),
        why: Why::FewSizes(sizes.len(), method).phrase(),
        ..Advice::at(AdviceKind::AddSizes, grid.budget_flops)
    };
    Some(advice.costed(grid.runs_per_cell()))
}

/// Vocabularies past the edge that the best run is on.
fn beyond_vocabularies(grid: &Grid, spacing: &Spacing) -> Advice {
    let tried = grid.vocabularies();
    let at = grid.best().n_vocab;
    let upwards = tried.iter().filter(|v| **v < at).count() * 2 + 1 > tried.len();
    let n_vocab = beyond(&tried, upwards, spacing.vocab_ratio(&tried), BEYOND);
    Advice {
        params_nonvocab: nearest(&grid.size_levels(), grid.best().params_nonvocab),
        n_vocab: n_vocab.into_iter().map(f64::round).filter(|v| *v >= 2.0).collect(),
        why: Why::VocabularyAtEdge { largest: upwards }.phrase(),
        ..Advice::at(AdviceKind::AddVocabularies, grid.budget_flops)
    }
    .costed(grid.runs_per_cell())
}

/// As many seeds again, at every size and its vocabularies nearest to the best.
fn more_seeds(grid: &Grid, why: Why) -> Advice {
    Advice {
        params_nonvocab: grid.size_levels(),
        n_vocab: nearest(&grid.vocabularies(), grid.best().n_vocab),
        why: why.phrase(),
        ..Advice::at(AdviceKind::AddSeeds, grid.budget_flops)
    }
    .costed(grid.runs_per_cell())
}

/// One budget further, by the sweep's own ratio of budgets.
fn next_budget(laws: &Laws, grids: &[Grid], spacing: &Spacing) -> Option<Advice> {
    let largest = grids.iter().max_by(|a, b| a.budget_flops.total_cmp(&b.budget_flops))?;
    let budgets: Vec<f64> = grids.iter().map(|grid| grid.budget_flops).collect();
    let budget = largest.budget_flops * median_ratio(&budgets)?;
    let size = laws.power_laws.size()?;
    let centre = size.value_at(budget);
    let (sizes, tried) = (largest.size_levels(), largest.vocabularies());
    let n_vocab = match optimal_vocabulary(laws, budget) {
        Some(v) if tried.len() > 1 => around(&[v], spacing.vocab_ratio(&tried), tried.len())
            .into_iter()
            .map(f64::round)
            .collect(),
        _ => tried,
    };
    let wide = wide_exponents(laws);
    let kind = if wide.is_empty() { AdviceKind::NextBudget } else { AdviceKind::LargerBudget };
    let advice = Advice {
        params_nonvocab: around(&[centre], spacing.size_ratio(&sizes), sizes.len()),
        n_vocab,
        why: Why::Next { wide, size: laws.parameters.size(), centre }.phrase(),
        ..Advice::at(kind, budget)
    };
    let usable = advice.params_nonvocab.iter().all(|n| n.is_finite() && *n > 0.0);
    usable.then(|| advice.costed(largest.runs_per_cell()))
}

/// The exponents that another budget would tell better, with the widths of their intervals.
fn wide_exponents(laws: &Laws) -> Vec<(&'static str, f64)> {
    let wide = |(name, law): (&'static str, &PowerLaw)| {
        let [low, high] = law.exponent_ci95?;
        (high - low > WIDE).then_some((name, high - low))
    };
    laws.power_laws.named().filter_map(wide).collect()
}

/// V at a budget by a power law through the fitted minima.
fn optimal_vocabulary(laws: &Laws, budget: f64) -> Option<f64> {
    if laws.parameters == Parameters::Total {
        return None;
    }
    let own = |m: &&Minimum| laws.fitted_budgets.contains(&m.budget_flops);
    let minima: Vec<&Minimum> = laws.own_minima().filter(own).collect();
    let budgets: Vec<f64> = minima.iter().map(|m| m.budget_flops).collect();
    let vocabularies: Vec<f64> = minima.iter().map(|m| m.n_vocab).collect();
    let weights = vec![1.0; budgets.len()];
    let law = power_law(&budgets, &vocabularies, geometric_mean(&budgets), &weights, None)?;
    Some(law.value_at(budget))
}

/// Up to [`NEIGHBOURS`] of some rising levels: the nearest to `at` and those beside it.
fn nearest(levels: &[f64], at: f64) -> Vec<f64> {
    let below = levels.iter().filter(|level| **level < at).count();
    let first = below.saturating_sub(NEIGHBOURS / 2).min(levels.len().saturating_sub(NEIGHBOURS));
    levels.iter().skip(first).take(NEIGHBOURS).copied().collect()
}

impl Advice {
    fn at(kind: AdviceKind, budget_flops: f64) -> Self {
        let why = String::new();
        Self {
            kind,
            budget_flops,
            params_nonvocab: vec![],
            n_vocab: vec![],
            runs: 0,
            flops: 0.0,
            why,
        }
    }

    /// Every size with every vocabulary, `per_cell` times, at the budget's cost each.
    fn costed(self, per_cell: usize) -> Self {
        let runs = self.params_nonvocab.len() * self.n_vocab.len().max(1) * per_cell;
        Self { runs, flops: runs as f64 * self.budget_flops, ..self }
    }
}

#[cfg(test)]
mod tests;
