//! The best configuration of each budget, by five methods.
//!
//! Every method averages over seeds first. Where a method finds no minimum inside what was tried,
//! the values it reports are those of the best run, with the flag that says so: no minimum is ever
//! extrapolated.

pub(in crate::laws) mod akima;
pub(in crate::laws) mod cross;
pub(in crate::laws) mod curve;
pub(in crate::laws) mod grid;
pub(in crate::laws) mod interpolate;
pub(in crate::laws) mod lost_runs;
pub(in crate::laws) mod run_noise;
pub(in crate::laws) mod select;
pub(in crate::laws) mod surface;
pub(in crate::laws) mod types;

use self::run_noise::RunNoise;
use self::types::{LackOfFit, Located, Minimum, MinimumFlag};
use crate::laws::input::budget::Budget;
use crate::laws::input::method::MinimumMethod;
use crate::laws::input::point::IsoFlopPoint;
use crate::laws::maths::stats::{chi_square_tail, student_t95};
pub(super) use grid::Grid;

/// The minimum of every budget by one method, in the order of `budgets`.
///
/// The curvature is weak where its 95 % interval holds zero. The noise is taken to be alike at all
/// budgets, so its variance is pooled over their residuals: a curve through three to five sizes
/// leaves too few of its own. Where no budget leaves a residual (three sizes each), the interval
/// is unknown and the flag is not raised; [`fit`](crate::laws::fit::fit()) says so.
pub fn minima(method: MinimumMethod, budgets: &[Budget]) -> Vec<Minimum> {
    of_grids(method, &budgets.iter().filter_map(Grid::new).collect::<Vec<_>>(), None)
}

/// [`minima`] of budgets that are gridded already; with the scatter of single runs known, a curve
/// that misfits is flagged.
pub(super) fn of_grids(
    method: MinimumMethod,
    grids: &[Grid],
    scatter: Option<RunNoise>,
) -> Vec<Minimum> {
    let located: Vec<_> = grids.iter().map(|grid| locate(method, grid)).collect();
    let noise = Noise::pooled(&located);
    let judged = |one: Located| {
        let misfits =
            scatter.and_then(|scatter| one.lack_of_fit(scatter)).is_some_and(|l| l.is_misfit());
        let mut minimum = flag_weak(one, noise);
        let has_curve = !minimum.is_best_run_instead();
        minimum.flag((misfits && has_curve).then_some(MinimumFlag::LackOfFit));
        minimum
    };
    let sd = scatter.map(|noise| noise.sd).or(noise.map(|noise| noise.sd)).unwrap_or_default();
    let deep = |(mut minimum, grid): (Minimum, &Grid)| {
        let below = grid.best().loss - minimum.loss_normalised;
        minimum.flag((below > grid.most_below_best(sd)).then_some(MinimumFlag::BelowRuns));
        minimum
    };
    located.into_iter().map(judged).zip(grids).map(deep).collect()
}

/// How far the runs of all budgets lie from the curves of a method, against their scatter; none where
/// no curve leaves residuals.
pub(super) fn lack_of_fit(
    method: MinimumMethod,
    grids: &[Grid],
    scatter: RunNoise,
) -> Option<LackOfFit> {
    let curves = grids.iter().filter_map(|grid| locate(method, grid).lack_of_fit(scatter));
    let (chi2, dof) = curves.fold((0.0, 0), |(chi2, dof), c| (chi2 + c.chi2, dof + c.dof));
    (dof > 0).then(|| lack(method, chi2, dof, scatter))
}

/// A χ² of the curves of a method, in units of a scatter.
fn lack(method: MinimumMethod, chi2: f64, dof: usize, scatter: RunNoise) -> LackOfFit {
    LackOfFit { method, chi2, dof, p: chi_square_tail(chi2, dof, scatter.dof) }
}

impl Located {
    /// How far the runs lie from the curve; none where it leaves no residuals.
    fn lack_of_fit(&self, scatter: RunNoise) -> Option<LackOfFit> {
        let curve = self.curvature.as_ref().filter(|c| c.dof > 0 && scatter.sd > 0.0)?;
        let chi2 = curve.rss * curve.runs / scatter.sd.powi(2);
        Some(lack(self.minimum.method, chi2, curve.dof, scatter))
    }
}

/// The minimum of one budget by one method, the noise taken from its own residuals; none for no
/// points. The points must have passed [`group_budgets`](crate::laws::input::budget::group_budgets).
pub fn minimum_at(method: MinimumMethod, points: &[&IsoFlopPoint]) -> Option<Minimum> {
    let budget_flops = points.first()?.budget_flops;
    minima(method, &[Budget { budget_flops, points: points.to_vec(), smaller: Vec::new() }]).pop()
}

/// Whether the fits behind these minima leave residuals to judge their curvature by.
pub(super) fn has_residuals(method: MinimumMethod, grids: &[Grid]) -> bool {
    let located: Vec<_> = grids.iter().map(|grid| locate(method, grid)).collect();
    Noise::pooled(&located).is_some() || located.iter().all(|one| one.curvature.is_none())
}

/// The minimum of one grid; whether its curvature is weak is not asked.
pub(super) fn of_grid(method: MinimumMethod, grid: &Grid) -> Minimum {
    let mut minimum = locate(method, grid).minimum;
    minimum.flag([]);
    minimum
}

fn locate(method: MinimumMethod, grid: &Grid) -> Located {
    match method {
        MinimumMethod::Argmin => argmin(grid),
        MinimumMethod::Parabola => curve::locate(method, 2, grid),
        MinimumMethod::Cubic => curve::locate(method, 3, grid),
        MinimumMethod::Akima => akima::locate(grid),
        MinimumMethod::Surface => surface::locate(grid),
    }
}

/// ScaMo's way: the best run, after the mean over seeds.
fn argmin(grid: &Grid) -> Located {
    let mut minimum = grid.best_run(MinimumMethod::Argmin, None);
    minimum.flag((grid.sizes.len() < 3).then_some(MinimumFlag::FewLevels));
    minimum.flag(grid.best_is_outermost_size().then_some(MinimumFlag::NotBracketed));
    minimum.flag(grid.doubts_of_best());
    Located { minimum, curvature: None }
}

/// The residual noise of several curves.
#[derive(Clone, Copy)]
struct Noise {
    sd: f64,
    dof: usize,
}

impl Noise {
    fn pooled(located: &[Located]) -> Option<Self> {
        let curvatures = || located.iter().filter_map(|one| one.curvature.as_ref());
        let dof: usize = curvatures().map(|c| c.dof).sum();
        let rss: f64 = curvatures().map(|c| c.rss).sum();
        (dof > 0).then(|| Self { sd: (rss / dof as f64).sqrt(), dof })
    }
}

fn flag_weak(located: Located, noise: Option<Noise>) -> Minimum {
    let Located { mut minimum, curvature } = located;
    if let (Some(curvature), Some(noise)) = (curvature, noise) {
        let margin = student_t95(noise.dof) * noise.sd * curvature.unit_error;
        if curvature.value <= margin {
            minimum.flag([MinimumFlag::WeakCurvature]);
        }
    }
    minimum
}

#[cfg(test)]
mod tests;
