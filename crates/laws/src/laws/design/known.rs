//! What the runs so far tell of the loss that is predicted, and what further ones would.

use super::belief::Belief;
use super::open_grid::{OpenGrid, of_budgets};
use super::open_run::OpenRun;
use crate::laws::input::budget::group_checked;
use crate::laws::input::point::{IsoFlopPoint, Parameters};
use crate::laws::joint::fit::fit_joint;
use crate::laws::joint::law::JointLaw;
use crate::laws::joint::loss::Place;
use crate::laws::joint::problem::{UNKNOWN_NOISE, expected_sds};
use crate::laws::joint::weighed::valley;
use crate::laws::maths::stats::distinct;
use crate::laws::minima::grid::Grid;
use crate::laws::noise::run_noise;
use crate::laws::noise::tokenizer_noise::runs_beside_tokenizers;

/// How far a law strays between budgets a factor e apart, in nats.
///
/// The errors of the laws' own forecasts are mostly the noise of minima, and would send all runs to
/// the largest budget: in simulated sweeps (`docs/rounds.md`) a walk of this size takes fewer FLOPs.
const DRIFT: f64 = 0.005;

/// What the runs so far tell.
pub(super) struct Known {
    law: JointLaw,
    belief: Belief,
    /// The combination whose variance is to fall.
    target: Vec<f64>,
    /// Those of the runs and the one that is predicted, rising.
    budgets: Vec<f64>,
    /// The lowest loss of each budget's grid by the law.
    best: Vec<f64>,
    /// Standard deviation of a run around the law, in nats.
    noise: f64,
}

impl Known {
    /// What `points` tell of the loss at the budget `target`; none where they tell no joint law.
    pub fn of(points: &[IsoFlopPoint], open: &[OpenRun], target: f64) -> Option<Self> {
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
            belief: Belief::new(prior(&law, &budgets)),
            best: budgets.iter().map(best_of).collect(),
            noise: noise.map_or(UNKNOWN_NOISE, |noise| noise.sd).max(law.residual_sd),
            budgets,
            law,
        };
        known.observe(trained.iter());
        Some(known)
    }

    /// The window of the smallest budget of which nothing is trained; else cells by gain per FLOP, until
    /// so many are spent.
    pub fn choose(mut self, points: &[IsoFlopPoint], open: &[OpenRun], spend: f64) -> Vec<usize> {
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

    /// What a run tells of the quantities, and the variance with which it does.
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

/// Coefficients as they are expected, and a walk in ln C from the smallest budget.
fn prior(law: &JointLaw, budgets: &[f64]) -> Vec<Vec<f64>> {
    let sds = expected_sds(&law.loss);
    let n = sds.len() + budgets.len();
    let mut covariance = vec![vec![0.0; n]; n];
    sds.iter().enumerate().for_each(|(i, sd)| covariance[i][i] = sd * sd);
    let far = |i: usize| (budgets[i] / budgets[0]).ln();
    for i in 0..budgets.len() {
        for j in 0..budgets.len() {
            covariance[sds.len() + i][sds.len() + j] = DRIFT * DRIFT * far(i.min(j));
        }
    }
    covariance
}
