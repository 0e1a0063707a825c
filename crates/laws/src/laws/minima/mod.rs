//! The best configuration of each budget, by five methods.
//!
//! Every method averages over seeds first. If a method finds no minimum inside the range tried, it reports the best
//! run, with a flag: no minimum is ever extrapolated.

mod curve;
mod grid;
mod minimum;
mod surface;

pub use grid::WIDEST_STEP;
pub(super) use grid::{Grid, Scale, loss_unit, lost_runs, n_vocabularies, valley};
pub(super) use minimum::{ByMethod, PREFERRED, hold_out, law_method, tell_laws, usable};
pub use minimum::{
    LackOfFit, Minimum, MinimumFlag, MinimumIntervals, NoiseSource, Optimum, RunNoise,
};
pub use surface::{CrossOptimum, TiedCells, TriedCells, cross_optimum, tied_cells};

use self::minimum::{Located, raised};
use crate::laws::input::budget::Budget;
use crate::laws::input::{FitOptions, IsoFlopPoint, MinimumMethod};
use crate::laws::maths::stats::{chi_square_tail, student_t95};

/// The minimum of every budget by one method, in the order of `budgets`.
///
/// The curvature is weak if its 95 % interval contains zero. The noise is assumed equal at all budgets, so its variance
/// is pooled over their residuals: a curve through three to five sizes has too few. If no budget has a residual (three
/// sizes each), the interval is unknown and the flag is not set; [`fit`](crate::laws::fit::fit()) warns of it.
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
    let sd = scatter.map(|noise| noise.sd).or(noise.map(|noise| noise.sd)).unwrap_or_default();
    let judged = |(one, grid): (Located, &Grid)| {
        let curvature = one.curvature.as_ref().zip(noise);
        let is_weak = curvature.is_some_and(|(curvature, noise)| {
            curvature.value <= student_t95(noise.dof) * noise.sd * curvature.unit_error
        });
        let lack = scatter.and_then(|scatter| one.lack_of_fit(scatter));
        let has_curve = !one.minimum.is_best_run_instead();
        let below = grid.best().loss - one.minimum.loss_normalised;
        let mut minimum = one.minimum;
        minimum.flag(raised([
            (is_weak, MinimumFlag::WeakCurvature),
            (has_curve && lack.is_some_and(|lack| lack.is_misfit()), MinimumFlag::LackOfFit),
            (below > grid.most_below_best(sd), MinimumFlag::BelowRuns),
        ]));
        minimum
    };
    located.into_iter().zip(grids).map(judged).collect()
}

/// The minima by each method asked for; without a method for the laws, the two that it may fall on too.
pub(in crate::laws) fn minima_by_method(
    grids: &[Grid],
    options: &FitOptions,
    scatter: Option<RunNoise>,
) -> Vec<(MinimumMethod, Vec<Minimum>)> {
    let mut methods = options.methods.clone();
    match options.law_method {
        Some(method) => methods.push(method),
        None => methods.extend([MinimumMethod::Argmin, MinimumMethod::Parabola]),
    }
    methods.sort();
    methods.dedup();
    methods.into_iter().map(|method| (method, of_grids(method, grids, scatter))).collect()
}

/// The distance of all runs from the curves of a method, relative to their noise; `None` if no curve has
/// residuals.
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
    /// The distance of the runs from the curve; `None` without residuals.
    fn lack_of_fit(&self, scatter: RunNoise) -> Option<LackOfFit> {
        let curve = self.curvature.as_ref().filter(|c| c.dof > 0 && scatter.sd > 0.0)?;
        let chi2 = curve.rss * curve.runs / scatter.sd.powi(2);
        Some(lack(self.minimum.method, chi2, curve.dof, scatter))
    }
}

/// The minimum of one budget by one method, the noise taken from its own residuals; none for no
/// points. The points must have passed [`group_budgets`](crate::laws::input::group_budgets).
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
        MinimumMethod::Parabola => curve::by_polynomial(method, 2, grid),
        MinimumMethod::Cubic => curve::by_polynomial(method, 3, grid),
        MinimumMethod::Akima => curve::by_spline(grid),
        MinimumMethod::Surface => surface::locate(grid),
    }
}

/// ScaMo's way: the best run, after the mean over seeds.
fn argmin(grid: &Grid) -> Located {
    let mut minimum = grid.best_run(MinimumMethod::Argmin, None);
    minimum.flag(raised([
        (grid.sizes.len() < 3, MinimumFlag::FewLevels),
        (grid.best_is_outermost_size(), MinimumFlag::NotBracketed),
    ]));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::input::group_budgets;
    use crate::laws::simulated::{SURFACE, Simulated, point};
    use proptest::prelude::*;

    /// Runs over sizes a constant factor apart, one vocabulary of 100, at the losses given.
    fn row(losses: &[f64]) -> Vec<IsoFlopPoint> {
        let size = |i: usize| 1e6 * 2f64.powi(i as i32);
        losses.iter().enumerate().map(|(i, loss)| point(size(i), 6400.0, *loss, 0)).collect()
    }

    fn at(method: MinimumMethod, points: &[IsoFlopPoint]) -> Minimum {
        minimum_at(method, &points.iter().collect::<Vec<_>>()).unwrap()
    }

    proptest! {
        #[test]
        fn the_parabola_and_the_cubic_find_the_vertex_of_an_exact_quadratic(
            vertex in 14.5..17.5f64,
            depth in -9.0..-0.1f64,
            curvature in 1e-3..10.0f64,
            n_sizes in 5usize..9,
        ) {
            let loss = |i: usize| {
                depth + curvature * ((1e6f64 * 2f64.powi(i as i32)).ln() - vertex).powi(2)
            };
            let points = row(&(0..n_sizes).map(loss).collect::<Vec<_>>());
            let largest = (1e6f64 * 2f64.powi(n_sizes as i32 - 1)).ln();
            prop_assume!(vertex < largest - 0.05);
            for method in [MinimumMethod::Parabola, MinimumMethod::Cubic, MinimumMethod::Akima] {
                let minimum = at(method, &points);
                prop_assert!(minimum.flags.is_empty(), "{minimum:?}");
                prop_assert!((minimum.params_nonvocab.ln() - vertex).abs() < 1e-7, "{minimum:?}");
                prop_assert!((minimum.loss_normalised - depth).abs() < 1e-9);
                let spent =
                    6.0 * (minimum.params_nonvocab + minimum.params_vocab) * minimum.tokens;
                prop_assert!((spent / 1e12 - 1.0).abs() < 1e-9);
                prop_assert!((minimum.params_vocab - 6400.0).abs() < 1e-6);
            }
        }

        #[test]
        fn the_surface_finds_the_minimum_of_an_exact_joint_quadratic(
            u0 in 14.2..15.5f64,
            v0 in 8.5..10.5f64,
            mixed in -0.15..0.15f64,
        ) {
            let loss = |n: f64, v: f64| {
                let (u, v) = (n.ln() - u0, v.ln() - v0);
                0.2 * u * u + mixed * u * v + 0.1 * v * v - 3.0
            };
            let grid = |i: i32, j: i32| (1e6 * 2f64.powi(i), 3000.0 * 3f64.powi(j));
            let cells = (0..4).flat_map(|i| (0..4).map(move |j| grid(i, j)));
            let points: Vec<_> = cells.map(|(n, v)| point(n, v, loss(n, v), 0)).collect();
            let minimum = at(MinimumMethod::Surface, &points);
            prop_assert!(minimum.flags.is_empty(), "{minimum:?}");
            prop_assert!((minimum.params_nonvocab.ln() - u0).abs() < 1e-8);
            prop_assert!((minimum.params_vocab.ln() - v0).abs() < 1e-8);
            prop_assert!((minimum.loss_normalised + 3.0).abs() < 1e-10);
        }

        #[test]
        fn no_losses_make_a_method_panic_or_leave_the_grid(
            losses in proptest::collection::vec(-9.0..9.0f64, 1..8),
        ) {
            let points = row(&losses);
            let (low, high) = (1e6 * (1.0 - 1e-9), 1e6 * 2f64.powi(losses.len() as i32));
            for method in [MinimumMethod::Argmin, MinimumMethod::Parabola, MinimumMethod::Cubic,
                MinimumMethod::Akima, MinimumMethod::Surface] {
                let minimum = at(method, &points);
                prop_assert!((low..high).contains(&minimum.params_nonvocab), "{minimum:?}");
                prop_assert!(minimum.tokens.is_finite() && minimum.loss_normalised.is_finite());
            }
        }
    }

    #[test]
    fn the_cubic_is_exact_where_the_parabola_is_biased() {
        let (x0, skew) = (15.5, 0.02);
        let loss = |i: usize| {
            let x = (1e6 * 2f64.powi(i as i32)).ln() - x0;
            -2.0 + 0.1 * x * x + skew * x * x * x
        };
        let points = row(&(0..6).map(loss).collect::<Vec<_>>());
        let cubic = at(MinimumMethod::Cubic, &points);
        let parabola = at(MinimumMethod::Parabola, &points);
        assert!((cubic.params_nonvocab.ln() - x0).abs() < 1e-8, "{cubic:?}");
        assert!((parabola.params_nonvocab.ln() - x0).abs() > 0.02, "{parabola:?}");
    }

    #[test]
    fn seeds_are_averaged_before_the_best_run_is_chosen() {
        let lucky = [point(1e6, 6400.0, -5.0, 0), point(1e6, 6400.0, -1.0, 1)];
        let steady = [point(2e6, 6400.0, -3.5, 0), point(2e6, 6400.0, -3.5, 1)];
        let minimum = at(MinimumMethod::Argmin, &[lucky, steady].concat());
        assert_eq!((minimum.params_nonvocab, minimum.loss_normalised), (2e6, -3.5));
    }

    #[test]
    fn a_minimum_at_the_smallest_size_is_not_bracketed() {
        let points = row(&[-3.0, -2.8, -2.4, -1.8, -1.0]);
        for method in [
            MinimumMethod::Argmin,
            MinimumMethod::Parabola,
            MinimumMethod::Cubic,
            MinimumMethod::Akima,
        ] {
            let minimum = at(method, &points);
            assert_eq!(minimum.flags, [MinimumFlag::NotBracketed], "{method}");
            assert_eq!((minimum.params_nonvocab, minimum.loss_normalised), (1e6, -3.0), "{method}");
        }
    }

    #[test]
    fn a_curve_that_opens_downwards_is_not_convex() {
        let points = row(&[-3.0, -2.0, -1.6, -2.1, -2.9]);
        assert_eq!(at(MinimumMethod::Parabola, &points).flags, [MinimumFlag::NotConvex]);
    }

    #[test]
    fn too_few_sizes_are_flagged_and_the_best_run_stands() {
        let two = row(&[-3.0, -2.0]);
        assert_eq!(at(MinimumMethod::Parabola, &two).flags, [MinimumFlag::FewLevels]);
        assert_eq!(at(MinimumMethod::Parabola, &two).loss_normalised, -3.0);
        let three = row(&[-2.0, -3.0, -2.0]);
        assert_eq!(at(MinimumMethod::Parabola, &three).flags, []);
        assert_eq!(at(MinimumMethod::Cubic, &three).flags, [MinimumFlag::FewLevels]);
        assert_eq!(at(MinimumMethod::Akima, &three).flags, [MinimumFlag::FewLevels]);
        assert_eq!(at(MinimumMethod::Surface, &three).flags, [MinimumFlag::FewLevels]);
    }

    #[test]
    fn a_flat_curve_under_noise_has_weak_curvature_and_a_steep_one_has_not() {
        let noise = [0.02, -0.03, 0.01, 0.03, -0.02, 0.01, -0.03];
        let losses = |curvature: f64| -> Vec<f64> {
            let bent = |(i, e): (usize, &f64)| curvature * (i as f64 - 3.1).powi(2) + e;
            noise.iter().enumerate().map(bent).collect()
        };
        let flat = at(MinimumMethod::Parabola, &row(&losses(4e-3)));
        let steep = at(MinimumMethod::Parabola, &row(&losses(0.1)));
        assert!(flat.flags.contains(&MinimumFlag::WeakCurvature), "{flat:?}");
        assert_eq!(steep.flags, []);
    }

    #[test]
    fn the_noise_of_one_budget_judges_the_curvature_of_another() {
        let quiet = row(&[-2.9, -3.0, -2.9]);
        let loud: Vec<_> = row(&[-2.0, -3.6, -2.2, -3.4, -2.1])
            .into_iter()
            .map(|p| IsoFlopPoint { budget_flops: 1e13, ..p })
            .collect();
        let points = [quiet.clone(), loud].concat();
        let together = minima(MinimumMethod::Parabola, &group_budgets(&points).unwrap());
        assert_eq!(at(MinimumMethod::Parabola, &quiet).flags, []);
        assert_eq!(together[0].flags, [MinimumFlag::WeakCurvature]);
    }

    #[test]
    fn the_outermost_vocabulary_is_an_edge_and_a_single_one_is_not() {
        let grid = |losses: [[f64; 3]; 3]| -> Vec<IsoFlopPoint> {
            let cell = |i: usize, j: usize| {
                point(1e6 * 2f64.powi(i as i32), 1e4 * 2f64.powi(j as i32), losses[i][j], 0)
            };
            (0..3).flat_map(|i| (0..3).map(move |j| cell(i, j))).collect()
        };
        let inside = grid([[-2.0, -2.1, -2.0], [-3.0, -3.1, -3.0], [-2.0, -2.1, -2.0]]);
        let edge = grid([[-2.0, -2.1, -2.2], [-3.0, -3.1, -3.2], [-2.0, -2.1, -2.2]]);
        for method in [MinimumMethod::Argmin, MinimumMethod::Parabola] {
            assert_eq!(at(method, &inside).flags, [], "{method}");
            let flags = [MinimumFlag::VocabNotBracketed, MinimumFlag::EdgeVocab];
            assert_eq!(at(method, &edge).flags, flags, "{method}");
            assert_eq!(at(method, &row(&[-2.0, -3.0, -2.0])).flags, [], "{method}");
        }
    }

    #[test]
    fn every_method_comes_close_to_the_true_optimum_of_a_simulated_budget() {
        let vocabularies = [2e3, 4e3, 8e3, 16e3, 32e3, 64e3, 128e3];
        let sweep = Simulated {
            budgets: &[1e16],
            n_sizes: 7,
            off_centre: 0.25,
            vocabularies: &vocabularies,
            n_seeds: 1,
            noise: 0.0,
            seed: 0,
        };
        let points = sweep.points();
        let (ln_nonvocab, ln_vocab) = SURFACE.optimum(1e16);
        for (method, near) in [
            (MinimumMethod::Argmin, 0.35),
            (MinimumMethod::Parabola, 0.1),
            (MinimumMethod::Cubic, 0.03),
            (MinimumMethod::Akima, 0.05),
            (MinimumMethod::Surface, 0.15),
        ] {
            let minimum = at(method, &points);
            let miss = (minimum.params_nonvocab.ln() - ln_nonvocab).abs();
            let miss_vocab = (minimum.params_vocab.ln() - ln_vocab).abs();
            assert!(miss < near, "{method} misses ln N_nv by {miss}");
            assert!(miss_vocab < 2.0 * near, "{method} misses ln N_v by {miss_vocab}");
        }
    }

    #[test]
    fn no_points_have_no_minimum() {
        assert_eq!(minimum_at(MinimumMethod::Parabola, &[]), None);
        assert_eq!(minima(MinimumMethod::Argmin, &[]), []);
    }
}
