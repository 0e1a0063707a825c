use super::*;
use crate::laws::input::budget::group_budgets;
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
    for method in
        [MinimumMethod::Argmin, MinimumMethod::Parabola, MinimumMethod::Cubic, MinimumMethod::Akima]
    {
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
