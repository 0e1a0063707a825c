//! Advice on further runs.
//!
//! Flagged minima get runs at their budget: sizes or vocabularies beyond an edge, more sizes if there are too few,
//! seeds if a curve is flat within its noise. There is always advice for one further budget, with a grid centred
//! on its predicted optimum.

use crate::laws::file::{Advice, AdviceKind, Laws};
use crate::laws::input::{MinimumMethod, Parameters};
use crate::laws::lines::{PowerLaw, power_law};
use crate::laws::maths::stats::{distinct, geometric_mean};
use crate::laws::minima::{Grid, Minimum, MinimumFlag, WIDEST_STEP};
use crate::laws::say::{
    why_few_sizes, why_gap, why_next, why_seeds, why_size_at_edge, why_vocabulary_at_edge,
};

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

/// The runs that would clear a minimum's flags.
fn mend(grid: &Grid, minimum: &Minimum, spacing: &Spacing) -> Vec<Advice> {
    let flags = &minimum.flags;
    // More levels cure both flags, and an edge is only known with enough levels.
    let few = flags.contains(&MinimumFlag::FewLevels);
    let advice = |flag: &MinimumFlag| match flag {
        MinimumFlag::FewLevels => few_levels(grid, minimum.method, spacing),
        MinimumFlag::NotBracketed if !few => Some(beyond_sizes(grid, spacing)),
        MinimumFlag::VocabNotBracketed => Some(beyond_vocabularies(grid, spacing)),
        MinimumFlag::WeakCurvature => Some(more_seeds(grid, true)),
        MinimumFlag::NotConvex => Some(more_seeds(grid, false)),
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
    let new = beyond(&sizes, upwards, spacing.size_ratio(&sizes), BEYOND);
    add_sizes(grid, new, why_size_at_edge(upwards))
}

/// A size in the middle of the gap that a minimum lies in.
fn between_sizes(grid: &Grid, minimum: &Minimum) -> Option<Advice> {
    let sizes = grid.size_levels();
    let above = sizes.partition_point(|n| *n <= minimum.params_nonvocab);
    let (left, right) = (*sizes.get(above.checked_sub(1)?)?, *sizes.get(above)?);
    Some(add_sizes(grid, vec![(left * right).sqrt()], why_gap(left, right)))
}

fn few_levels(grid: &Grid, method: MinimumMethod, spacing: &Spacing) -> Option<Advice> {
    let sizes = grid.size_levels();
    (sizes.len() < ENOUGH_SIZES).then(|| {
        let mut new = around(&sizes, spacing.size_ratio(&sizes), ENOUGH_SIZES);
        new.retain(|n| !sizes.contains(n));
        add_sizes(grid, new, why_few_sizes(sizes.len(), method))
    })
}

/// Vocabularies past the edge that the best run is on.
fn beyond_vocabularies(grid: &Grid, spacing: &Spacing) -> Advice {
    let tried = grid.vocabularies();
    let at = grid.best().n_vocab;
    let upwards = tried.iter().filter(|v| **v < at).count() * 2 + 1 > tried.len();
    let new = beyond(&tried, upwards, spacing.vocab_ratio(&tried), BEYOND);
    let new = new.into_iter().map(f64::round).filter(|v| *v >= 2.0).collect();
    let sizes = nearest(&grid.size_levels(), grid.best().params_nonvocab);
    let why = why_vocabulary_at_edge(upwards);
    Advice::new(AdviceKind::AddVocabularies, grid.budget_flops, [sizes, new], grid, why)
}

/// As many seeds again, at every size and its vocabularies nearest to the best.
fn more_seeds(grid: &Grid, has_minimum: bool) -> Advice {
    Advice {
        kind: AdviceKind::AddSeeds,
        ..add_sizes(grid, grid.size_levels(), why_seeds(has_minimum))
    }
}

/// Sizes with the vocabularies nearest to the best.
fn add_sizes(grid: &Grid, sizes: Vec<f64>, why: String) -> Advice {
    let n_vocab = nearest(&grid.vocabularies(), grid.best().n_vocab);
    Advice::new(AdviceKind::AddSizes, grid.budget_flops, [sizes, n_vocab], grid, why)
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
    let why = why_next(&wide, laws.parameters.size(), centre);
    let sizes = around(&[centre], spacing.size_ratio(&sizes), sizes.len());
    let usable = sizes.iter().all(|n| n.is_finite() && *n > 0.0);
    usable.then(|| Advice::new(kind, budget, [sizes, n_vocab], largest, why))
}

/// The exponents that another budget would improve, with the widths of their intervals.
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

/// Up to [`NEIGHBOURS`] of some rising levels: the nearest to `at` and its neighbours.
fn nearest(levels: &[f64], at: f64) -> Vec<f64> {
    let below = levels.iter().filter(|level| **level < at).count();
    let first = below.saturating_sub(NEIGHBOURS / 2).min(levels.len().saturating_sub(NEIGHBOURS));
    levels.iter().skip(first).take(NEIGHBOURS).copied().collect()
}

impl Advice {
    /// Every size with every vocabulary, as often as a cell of `like`, at the budget's cost each.
    fn new(
        kind: AdviceKind,
        budget_flops: f64,
        [params_nonvocab, n_vocab]: [Vec<f64>; 2],
        like: &Grid,
        why: String,
    ) -> Self {
        let runs = params_nonvocab.len() * n_vocab.len().max(1) * like.runs_per_cell();
        let flops = runs as f64 * budget_flops;
        Self { kind, budget_flops, params_nonvocab, n_vocab, runs, flops, why }
    }
}

// Levels of a grid, continued by the grid's own ratio.

/// The ratio of neighbouring levels if a sweep has none.
const DEFAULT_RATIO: f64 = 2.0;
/// Models that can be built lie off the sizes that are asked for.
const MARGIN: f64 = 0.88;

/// The sweep's own ratios of neighbouring levels, if it has them.
struct Spacing {
    size: Option<f64>,
    vocab: Option<f64>,
}

impl Spacing {
    /// The first ratios that any budget shows.
    fn of(grids: &[Grid]) -> Self {
        Self {
            size: grids.iter().find_map(|grid| median_ratio(&grid.size_levels())),
            vocab: grids.iter().find_map(|grid| median_ratio(&grid.vocabularies())),
        }
    }

    /// The ratio of these sizes; else the sweep's; else 2; no wider than a minimum between two may have.
    fn size_ratio(&self, sizes: &[f64]) -> f64 {
        median_ratio(sizes).or(self.size).unwrap_or(DEFAULT_RATIO).min(MARGIN * WIDEST_STEP)
    }

    /// The ratio of these vocabularies; else the sweep's; else 2.
    fn vocab_ratio(&self, vocabularies: &[f64]) -> f64 {
        median_ratio(vocabularies).or(self.vocab).unwrap_or(DEFAULT_RATIO)
    }
}

/// The median ratio of neighbours, the upper one of an even number; none for fewer than two levels.
fn median_ratio(levels: &[f64]) -> Option<f64> {
    let sorted = distinct(levels.iter().copied());
    let mut ratios: Vec<f64> = sorted.windows(2).map(|pair| pair[1] / pair[0]).collect();
    ratios.sort_by(f64::total_cmp);
    ratios.get(ratios.len() / 2).copied()
}

/// `n` levels past the highest or the lowest of rising ones, in rising order.
fn beyond(levels: &[f64], upwards: bool, ratio: f64, n: usize) -> Vec<f64> {
    let step = if upwards { ratio } else { 1.0 / ratio };
    let end = if upwards { levels.last() } else { levels.first() };
    let new = end.map(|end| (1..=n).map(move |i| end * step.powi(i as i32)));
    distinct(new.into_iter().flatten())
}

/// Rising levels filled up to `n` by turns above and below; one level so becomes the centre.
fn around(levels: &[f64], ratio: f64, n: usize) -> Vec<f64> {
    let mut all = levels.to_vec();
    while let (Some(first), Some(last)) = (all.first(), all.last())
        && all.len() < n
    {
        let upwards = (all.len() - levels.len()).is_multiple_of(2);
        let (at, new) = if upwards { (all.len(), last * ratio) } else { (0, first / ratio) };
        all.insert(at, new);
    }
    all
}

impl Grid {
    /// The sizes tried, rising.
    fn size_levels(&self) -> Vec<f64> {
        distinct(self.sizes.iter().map(|size| size.best.params_nonvocab))
    }

    /// The vocabularies tried, rising; empty if no cell has one.
    fn vocabularies(&self) -> Vec<f64> {
        distinct(self.cells.iter().map(|cell| cell.n_vocab).filter(|v| *v > 0.0))
    }

    /// Runs of a cell, rounded.
    fn runs_per_cell(&self) -> usize {
        (self.n_runs as f64 / self.cells.len() as f64).round().max(1.0) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fit::fit;
    use crate::laws::input::{FitOptions, IsoFlopPoint};
    use crate::laws::simulated::{SWEEP, Simulated};

    #[test]
    fn levels_continue_by_their_own_ratio() {
        let ratio = median_ratio(&[1.0, 2.0, 4.0, 9.0]).unwrap();
        assert_eq!(ratio, 2.0);
        assert_eq!(beyond(&[1.0, 2.0], true, ratio, 2), [4.0, 8.0]);
        assert_eq!(beyond(&[1.0, 2.0], false, ratio, 2), [0.25, 0.5]);
        assert_eq!(around(&[8.0], ratio, 3), [4.0, 8.0, 16.0]);
        assert_eq!(around(&[4.0, 8.0], ratio, 5), [2.0, 4.0, 8.0, 16.0, 32.0]);
        assert_eq!(median_ratio(&[3.0]), None);
        assert!(around(&[], ratio, 3).is_empty());
    }

    fn laws(points: &[IsoFlopPoint]) -> Laws {
        fit(points, &FitOptions { bootstrap: 100, ..FitOptions::default() }).unwrap()
    }

    fn at(laws: &Laws, budget: f64) -> Vec<&Advice> {
        laws.advice.iter().filter(|advice| advice.budget_flops == budget).collect()
    }

    #[test]
    fn a_sound_sweep_is_told_where_its_next_budget_lies_and_what_it_costs() {
        let laws = laws(&SWEEP.points());
        let [next] = &laws.advice[..] else { panic!("{:?}", laws.advice) };
        assert_eq!(next.kind, AdviceKind::NextBudget);
        assert!((next.budget_flops / (1e17 * 1e17 / 3e16) - 1.0).abs() < 1e-9, "{next:?}");
        assert_eq!((next.params_nonvocab.len(), next.n_vocab.len(), next.runs), (7, 5, 35));
        assert_eq!(next.flops, 35.0 * next.budget_flops);
        let centre = laws.power_laws.params_nonvocab.as_ref().unwrap().value_at(next.budget_flops);
        assert!((next.params_nonvocab[3] / centre - 1.0).abs() < 1e-12);
        assert!((next.params_nonvocab[4] / centre - 1.8).abs() < 1e-6);
    }

    #[test]
    fn sizes_are_added_beyond_the_edge_that_the_minimum_is_on() {
        let mut points = SWEEP.points();
        points.retain(|p| p.budget_flops != 3e15 || p.params_nonvocab > 2.5e7);
        let laws = laws(&points);
        let [mend] = at(&laws, 3e15)[..] else { panic!("{:?}", laws.advice) };
        let smallest = points.iter().filter(|p| p.budget_flops == 3e15);
        let smallest = smallest.map(|p| p.params_nonvocab).fold(f64::INFINITY, f64::min);
        assert_eq!(mend.kind, AdviceKind::AddSizes);
        assert!((mend.params_nonvocab[1] * 1.8 / smallest - 1.0).abs() < 1e-6, "{mend:?}");
        assert_eq!((mend.params_nonvocab.len(), mend.runs), (2, 2 * mend.n_vocab.len()));
        assert!(mend.why.contains("smallest"), "{}", mend.why);
    }

    #[test]
    fn vocabularies_are_added_beyond_the_edge_that_the_best_run_is_on() {
        let mut points = SWEEP.points();
        points.retain(|p| p.budget_flops != 1e16 || p.n_vocab > 3e4);
        let laws = laws(&points);
        let [mend] = at(&laws, 1e16)[..] else { panic!("{:?}", laws.advice) };
        assert_eq!(
            (mend.kind, &mend.n_vocab[..]),
            (AdviceKind::AddVocabularies, &[7500.0, 22500.0][..])
        );
    }

    #[test]
    fn too_few_sizes_are_filled_up_to_five() {
        let mut points = SWEEP.points();
        let kept: Vec<f64> = points.iter().map(|p| p.params_nonvocab).collect();
        points.retain(|p| p.budget_flops != 1e15 || kept[..10].contains(&p.params_nonvocab));
        let laws = laws(&points);
        let [mend] = at(&laws, 1e15)[..] else { panic!("{:?}", laws.advice) };
        assert_eq!((mend.kind, mend.params_nonvocab.len()), (AdviceKind::AddSizes, 3));
    }

    #[test]
    fn a_wide_interval_asks_for_a_larger_budget() {
        let laws = laws(
            &Simulated { budgets: &[1e16, 2e16, 4e16], noise: 0.03, n_seeds: 2, ..SWEEP }.points(),
        );
        let next = laws.advice.last().unwrap();
        assert_eq!(next.kind, AdviceKind::LargerBudget);
        assert!(next.why.contains("wide") && next.runs == 70, "{next:?}");
    }
}
