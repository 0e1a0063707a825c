//! Chooses the next runs of a grid: those that narrow a prediction most per FLOP.
//!
//! The two cheapest budgets are trained in full. Each further budget starts with a window of its grid around the
//! optimum by the joint law of all runs so far, because a budget's minimum is read off a curve. Then windows grow
//! cell by cell.
//!
//! The belief about losses is normal: the coefficients of the joint law, plus a random walk in ln C, since no law is
//! equally right at every budget. A run observes both, with noise. The amount by which a cell would lower the
//! variance of the predicted loss has a closed form that needs no training (c-optimal design, Elfving 1952). Cells
//! are chosen by this gain per FLOP.

mod open_grid;

pub use open_grid::OpenRun;

use crate::laws::input::{IsoFlopPoint, Parameters, group_checked};
use crate::laws::joint::{JointLaw, Place, expected_sds, fit_joint};
use crate::laws::maths::stats::{distinct, dot};
use crate::laws::minima::{Grid, RunNoise, loss_unit, valley};
use crate::laws::noise::{run_noise, runs_beside_tokenizers};
use open_grid::{OpenGrid, of_budgets};

/// Budgets that are trained whole before anything is known.
const FEWEST_BUDGETS: usize = 2;

/// The goal of choosing runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DesignGoal {
    /// The budget whose loss is predicted.
    pub budget_flops: f64,
    /// FLOPs to spend at least, where windows grow.
    pub spend_flops: f64,
}

/// The next runs, as indices into `open`, given the trained `points`.
pub fn next_runs(points: &[IsoFlopPoint], open: &[OpenRun], goal: DesignGoal) -> Vec<usize> {
    match Known::of(points, open, goal.budget_flops) {
        Some(known) => known.choose(points, open, goal.spend_flops),
        None => cheapest(points, open),
    }
}

/// Whole budgets, the cheapest first: two if none is trained yet, else one.
fn cheapest(points: &[IsoFlopPoint], open: &[OpenRun]) -> Vec<usize> {
    let budgets = distinct(open.iter().map(|run| run.budget_flops));
    let count = if points.is_empty() { FEWEST_BUDGETS } else { 1 };
    let first = &budgets[..count.min(budgets.len())];
    (0..open.len()).filter(|i| first.contains(&open[*i].budget_flops)).collect()
}

// The belief about the predicted loss, from runs so far and from further ones.

/// How far a law strays between budgets a factor e apart, in what is worth a nat.
///
/// The errors of the laws' own forecasts are mostly the noise of minima, and would send all runs to
/// the largest budget: in simulated sweeps (`docs/rounds.md`) a walk of this size takes fewer FLOPs.
const DRIFT: f64 = 0.005;

/// The information of the runs so far.
struct Known {
    law: JointLaw,
    belief: Belief,
    /// The combination whose variance is to fall.
    target: Vec<f64>,
    /// The budgets of the runs and the predicted one, rising.
    budgets: Vec<f64>,
    /// The lowest loss of each budget's grid by the law.
    best: Vec<f64>,
    /// Standard deviation of a run around the law.
    noise: f64,
}

impl Known {
    /// The belief about the loss at the budget `target` from `points`; `None` if they give no joint law.
    fn of(points: &[IsoFlopPoint], open: &[OpenRun], target: f64) -> Option<Self> {
        let has_vocab = points.iter().all(|point| point.n_vocab > 0.0);
        let parameters = if has_vocab { Parameters::Split } else { Parameters::Total };
        let groups = group_checked(points, parameters).ok()?;
        let grids: Vec<Grid> = groups.iter().filter_map(Grid::new).collect();
        let noise = run_noise(&grids, runs_beside_tokenizers(&groups));
        let law = fit_joint(&grids, noise, true).or_else(|| fit_joint(&grids, noise, false))?;
        let trained: Vec<OpenRun> = points.iter().map(OpenRun::of).collect();
        let all = || trained.iter().chain(open);
        let budgets = all().map(|run| run.budget_flops).chain([target]);
        let budgets = distinct(budgets);
        let best_of = |budget: &f64| {
            let own = all().filter(|run| run.budget_flops == *budget);
            own.map(|run| law.loss.value(&run.place())).fold(f64::INFINITY, f64::min)
        };
        let mut known = Self {
            target: lowest(&law, &budgets, target)?,
            belief: Belief(prior(&law, &budgets, loss_unit(&grids))),
            best: budgets.iter().map(best_of).collect(),
            noise: RunNoise::sd_or_guess(noise, &grids).max(law.residual_sd),
            budgets,
            law,
        };
        known.observe(trained.iter());
        Some(known)
    }

    /// The window of the smallest budget of which nothing is trained; else cells by gain per FLOP, until
    /// so many are spent.
    fn choose(mut self, points: &[IsoFlopPoint], open: &[OpenRun], spend: f64) -> Vec<usize> {
        let mut grids = of_budgets(points, open);
        let beyond: Vec<usize> = grids.iter().flat_map(OpenGrid::beyond_edges).collect();
        if !beyond.is_empty() {
            return beyond;
        }
        if let Some(new) = grids.iter().find(|grid| grid.is_untouched())
            && let Some(optimum) = self.law.optimum(new.budget_flops)
        {
            return new.window(optimum.params_nonvocab, optimum.n_vocab.unwrap_or_default());
        }
        let (mut chosen, mut spent) = (Vec::new(), 0.0);
        while spent < spend
            && let Some(cell) = self.best_cell(&grids, open)
        {
            self.observe(cell.iter().map(|i| &open[*i]));
            grids.iter_mut().for_each(|grid| grid.take(&cell));
            spent += flops(&cell, open);
            chosen.extend(cell);
        }
        chosen
    }

    /// The cell of the most gain per FLOP.
    fn best_cell(&self, grids: &[OpenGrid], open: &[OpenRun]) -> Option<Vec<usize>> {
        let now = self.belief.variance(&self.target);
        let worth = |cell: &Vec<usize>| {
            let mut after = self.belief.clone();
            let rows = cell.iter().map(|i| self.observation(&open[*i]));
            rows.for_each(|(row, variance)| after.observe(&row, variance));
            (now - after.variance(&self.target)) / flops(cell, open)
        };
        let priced = grids.iter().flat_map(OpenGrid::cells).map(|cell| (worth(&cell), cell));
        priced.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, cell)| cell)
    }

    fn observe<'a>(&mut self, runs: impl Iterator<Item = &'a OpenRun>) {
        for run in runs {
            let (row, variance) = self.observation(run);
            self.belief.observe(&row, variance);
        }
    }

    /// The observation of a run: its row over the quantities, and its variance.
    fn observation(&self, run: &OpenRun) -> (Vec<f64>, f64) {
        let place = run.place();
        let budget = self.budgets.iter().position(|budget| *budget == run.budget_flops);
        let above = budget.map_or(0.0, |i| self.law.loss.value(&place) - self.best[i]);
        let variance = self.noise.powi(2) / valley(above, self.noise);
        (row(&self.law, &place, &self.budgets, run.budget_flops), variance)
    }
}

fn flops(runs: &[usize], open: &[OpenRun]) -> f64 {
    runs.iter().map(|i| open[*i].flops).sum()
}

/// The derivatives of a run's loss by the coefficients, and its budget's place in the walk.
fn row(law: &JointLaw, place: &Place, budgets: &[f64], budget: f64) -> Vec<f64> {
    let own = budgets.iter().map(|other| f64::from(u8::from(*other == budget)));
    law.loss.gradient(place).into_iter().chain(own).collect()
}

/// The lowest loss of the budget that is predicted. Where a loss is lowest, it does not change with
/// the place.
fn lowest(law: &JointLaw, budgets: &[f64], budget: f64) -> Option<Vec<f64>> {
    let best = law.optimum(budget)?;
    let at = [best.params_nonvocab, best.n_vocab.unwrap_or_default(), best.tokens];
    Some(row(law, &Place::new(at, law.loss.unique_tokens), budgets, budget))
}

/// Coefficients as they are expected, and a walk in ln C from the smallest budget; `unit` of the loss is worth a nat.
fn prior(law: &JointLaw, budgets: &[f64], unit: f64) -> Vec<Vec<f64>> {
    let (sds, drift) = (expected_sds(&law.loss, unit), DRIFT * unit);
    let n = sds.len() + budgets.len();
    let mut covariance = vec![vec![0.0; n]; n];
    sds.iter().enumerate().for_each(|(i, sd)| covariance[i][i] = sd * sd);
    let far = |i: usize| (budgets[i] / budgets[0]).ln();
    for i in 0..budgets.len() {
        for j in 0..budgets.len() {
            covariance[sds.len() + i][sds.len() + j] = drift * drift * far(i.min(j));
        }
    }
    covariance
}

/// A normal belief: the covariance of the quantities.
#[derive(Clone, Debug)]
struct Belief(Vec<Vec<f64>>);

impl Belief {
    /// Variance of the combination `row` of the quantities.
    fn variance(&self, row: &[f64]) -> f64 {
        dot(&self.with(row), row)
    }

    /// Covariance of the combination `row` with each of the quantities.
    fn with(&self, row: &[f64]) -> Vec<f64> {
        self.0.iter().map(|own| dot(own, row)).collect()
    }

    /// The belief after an observation of `row`, itself of variance `noise`.
    fn observe(&mut self, row: &[f64], noise: f64) {
        let with = self.with(row);
        let total = noise + dot(&with, row);
        for (own, a) in self.0.iter_mut().zip(&with) {
            own.iter_mut().zip(&with).for_each(|(own, b)| *own -= a * b / total);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::input::RunFacts;
    use crate::laws::simulated::{SWEEP, Simulated};

    #[test]
    fn observations_give_the_variance_of_least_squares() {
        let mut belief = Belief(vec![vec![1e6, 0.0], vec![0.0, 1e6]]);
        let xs = [0.0, 1.0, 2.0, 4.0];
        let noise = 0.09;
        for x in xs {
            belief.observe(&[1.0, x], noise);
        }
        // σ² (1/n + (x − x̄)²/Sxx) at x = 6: n = 4, x̄ = 1.75, Sxx = 8.75.
        let expected = noise * (0.25 + 4.25f64.powi(2) / 8.75);
        let target = [1.0, 6.0];
        assert!((belief.variance(&target) / expected - 1.0).abs() < 1e-4);
    }

    const GRID: Simulated = Simulated { n_sizes: 9, ..SWEEP };

    fn runs(points: &[IsoFlopPoint]) -> Vec<OpenRun> {
        points.iter().map(OpenRun::of).collect()
    }

    fn goal() -> DesignGoal {
        DesignGoal { budget_flops: 1e18, spend_flops: 1e17 }
    }

    /// What is trained after each round, until nothing is left.
    fn rounds(all: &[IsoFlopPoint]) -> Vec<Vec<IsoFlopPoint>> {
        let (mut trained, mut left): (Vec<IsoFlopPoint>, _) = (Vec::new(), all.to_vec());
        let mut history = Vec::new();
        while !left.is_empty() {
            let chosen = next_runs(&trained, &runs(&left), goal());
            assert!(!chosen.is_empty(), "{} runs are left", left.len());
            trained.extend(chosen.iter().map(|i| left[*i].clone()));
            let mut place = 0..;
            left.retain(|_| place.next().is_some_and(|i| !chosen.contains(&i)));
            history.push(trained.clone());
        }
        history
    }

    fn at(points: &[IsoFlopPoint], budget: f64) -> Vec<&IsoFlopPoint> {
        points.iter().filter(|point| point.budget_flops == budget).collect()
    }

    #[test]
    fn the_two_cheapest_budgets_come_first_and_whole() {
        let all = GRID.points();
        let first = &rounds(&all)[0];
        assert_eq!(first.len(), 2 * 9 * 5);
        assert!(first.iter().all(|point| point.budget_flops <= 3e15));
    }

    #[test]
    fn each_further_budget_begins_with_a_window_around_its_optimum() {
        let all = GRID.points();
        let history = rounds(&all);
        for budget in [1e16, 3e16, 1e17] {
            let begun = history.iter().find(|trained| !at(trained, budget).is_empty()).unwrap();
            let own = at(begun, budget);
            assert_eq!(own.len(), 15, "{budget:e}");
            let best =
                at(&all, budget).into_iter().min_by(|a, b| a.loss.total_cmp(&b.loss)).unwrap();
            assert!(own.contains(&best), "{budget:e}");
        }
    }

    #[test]
    fn every_run_is_chosen_once_and_the_same_way_each_time() {
        let all = GRID.points();
        let (once, again) = (rounds(&all), rounds(&all));
        assert_eq!(once, again);
        let last = once.last().unwrap();
        let mut ids: Vec<&str> = last.iter().map(|point| point.run_id.as_str()).collect();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!((ids.len(), last.len()), (all.len(), all.len()));
    }

    #[test]
    fn an_optimum_at_the_edge_of_its_window_widens_it_there() {
        let all = GRID.points();
        // The third budget was begun with the five smallest sizes alone.
        let is_small = |point: &&IsoFlopPoint| {
            let mut sizes: Vec<f64> = at(&all, 1e16).iter().map(|p| p.params_nonvocab).collect();
            sizes.sort_by(f64::total_cmp);
            sizes.dedup();
            point.budget_flops < 1e16
                || (point.budget_flops == 1e16 && point.params_nonvocab <= sizes[2])
        };
        let trained: Vec<IsoFlopPoint> = all.iter().filter(is_small).cloned().collect();
        let left: Vec<IsoFlopPoint> = all.iter().filter(|p| !is_small(p)).cloned().collect();
        let chosen = next_runs(&trained, &runs(&left), goal());
        let mut sizes: Vec<f64> = chosen.iter().map(|i| left[*i].params_nonvocab).collect();
        sizes.dedup();
        assert_eq!(sizes.len(), 1, "{sizes:?}");
        assert!(chosen.iter().all(|i| left[*i].budget_flops == 1e16));
        let smallest =
            at(&left, 1e16).iter().map(|p| p.params_nonvocab).fold(f64::INFINITY, f64::min);
        assert_eq!(sizes[0], smallest);
    }

    #[test]
    fn tables_of_n_alone_are_chosen_from_too() {
        let total = |point: IsoFlopPoint| IsoFlopPoint {
            params_nonvocab: point.params_nonvocab + point.params_vocab,
            params_vocab: 0.0,
            n_vocab: 0.0,
            about: RunFacts::default(),
            ..point
        };
        let sweep = Simulated { vocabularies: &[22500.0], n_seeds: 2, ..GRID };
        let all: Vec<IsoFlopPoint> = sweep.points().into_iter().map(total).collect();
        let history = rounds(&all);
        assert_eq!(history.last().unwrap().len(), all.len());
        assert!(history.len() > 4);
    }
}
