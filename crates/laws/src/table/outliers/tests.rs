//! Made tables with bad runs at known places.

use super::*;
use crate::laws::Normals;
use crate::laws::simulated;

#[test]
fn the_vertex_of_an_exact_parabola_is_found() {
    let z = [-1.0, -0.7, 0.1, 0.3, 1.0];
    let y = z.map(|z: f64| 2.0 + 0.3 * (z - 0.45).powi(2));
    assert!((vertex(&z, &y).unwrap() - 0.45).abs() < 1e-13);
    assert_eq!(vertex(&z, &z), None);
    assert_eq!(vertex(&z, &y.map(|y| -y)), None);
}

/// A run of a budget with one N and loss.
fn run(budget_flops: f64, params_nonvocab: f64, loss: f64) -> IsoFlopPoint {
    IsoFlopPoint {
        run_id: format!("{budget_flops:.2e} {params_nonvocab:.2e}"),
        budget_flops,
        ..simulated::point(params_nonvocab, 0.0, loss, 0)
    }
}

/// `n_budgets` half a decade apart, of `n_sizes` each around the optimum of Hoffmann et al.'s loss.
fn table(n_budgets: usize, n_sizes: usize, noise: f64, seed: u64) -> Vec<IsoFlopPoint> {
    let mut normals = Normals::of_stream(seed, 0);
    let budgets = (0..n_budgets).map(|i| 1e18 * 10f64.powf(0.5 * i as f64));
    let sizes = |c: f64| {
        let n = move |i: usize| {
            let steps = i as f64 - 0.5 * (n_sizes as f64 - 1.0);
            3e8 * (c / 1e18).sqrt() * (0.2 + 0.6 * steps).exp()
        };
        (0..n_sizes).map(move |i| (c, n(i)))
    };
    let loss = |c: f64, n: f64| 1.69 + 406.4 * n.powf(-0.34) + 410.7 * (c / 6.0 / n).powf(-0.28);
    let made = budgets.flat_map(sizes);
    made.map(|(c, n)| run(c, n, loss(c, n) + noise * normals.draw())).collect()
}

const NOISE: f64 = 0.005;

/// The rows that are dropped of a table after some losses were moved, and the doubts.
fn dropped(mut points: Vec<IsoFlopPoint>, bad: &[(usize, f64)]) -> (Vec<usize>, Vec<String>) {
    bad.iter().for_each(|(row, by)| points[*row].loss += by);
    let split = OutlierStage::Spline.split(points.clone());
    let row = |out: &IsoFlopPoint| points.iter().position(|point| point == out);
    (split.dropped.iter().filter_map(|(out, _)| row(out)).collect(), split.doubts)
}

/// Of `seeds` tables how many lose the bad row alone, and how many lose a sound one.
fn found(n_budgets: usize, n_sizes: usize, place: usize, by: f64, seeds: u64) -> [usize; 2] {
    let one = |seed: u64| {
        let row = seed as usize % n_budgets * n_sizes + place;
        let out = dropped(table(n_budgets, n_sizes, NOISE, seed), &[(row, by)]).0;
        (out == [row], out.iter().any(|other| *other != row))
    };
    let all: Vec<(bool, bool)> = (0..seeds).map(one).collect();
    [all.iter().filter(|one| one.0).count(), all.iter().filter(|one| one.1).count()]
}

#[test]
fn tables_of_noise_alone_lose_a_row_in_one_of_fifty_at_most() {
    for (n_budgets, n_sizes) in
        [(1, 5), (1, 7), (1, 11), (3, 3), (3, 4), (3, 5), (5, 3), (5, 4), (5, 7), (5, 11)]
    {
        let out = (0..200).filter(|seed| {
            let (out, doubts) = dropped(table(n_budgets, n_sizes, NOISE, 1000 + seed), &[]);
            !out.is_empty() || doubts.iter().any(|doubt| doubt.contains("dropped none"))
        });
        let out = out.count();
        println!("{n_budgets} budgets of {n_sizes} sizes: {out} of 200");
        assert!(out <= 4, "{n_budgets} budgets of {n_sizes} sizes: {out}");
    }
}

#[test]
fn a_smooth_table_loses_nothing_however_wide_its_budgets_are() {
    for (n_budgets, n_sizes) in [(1, 9), (3, 5), (4, 9), (5, 11), (6, 11)] {
        let (out, doubts) = dropped(table(n_budgets, n_sizes, 0.0, 0), &[]);
        assert!(out.is_empty() && doubts.is_empty(), "{n_budgets}, {n_sizes}: {out:?}, {doubts:?}");
    }
}

#[test]
fn a_bad_run_goes_wherever_it_stands_and_its_neighbours_stay() {
    for n_sizes in [7, 9] {
        for place in [0, 1, n_sizes / 2, n_sizes - 2, n_sizes - 1] {
            for by in [0.3, -0.3] {
                let [right, wrong] = found(5, n_sizes, place, by, 40);
                println!("{n_sizes} sizes, place {place}, {by:+}: {right} of 40, {wrong} wrong");
                assert!(right >= 28 && wrong <= 1, "{n_sizes}, {place}, {by}: {right}, {wrong}");
            }
        }
    }
}

#[test]
fn the_other_budgets_tell_which_of_four_or_three_sizes_is_bad() {
    for (n_budgets, n_sizes, least) in [(3, 4, 20), (5, 4, 36), (5, 3, 20)] {
        for place in 0..n_sizes {
            let [right, wrong] = found(n_budgets, n_sizes, place, 0.3, 40);
            println!("{n_budgets} of {n_sizes}, place {place}: {right} of 40, {wrong} wrong");
            assert!(right >= least && wrong <= 1, "{n_sizes}, {place}: {right}, {wrong}");
        }
    }
}

#[test]
fn two_bad_runs_go_both() {
    for bad in [
        [(0, 0.4), (12, 0.3)],
        [(14, 0.3), (20, -0.3)],
        [(16, 0.5), (17, 0.3)],
        [(7, 0.4), (30, 0.3)],
    ] {
        let right = (0..20).filter(|seed| {
            let mut out = dropped(table(5, 7, NOISE, *seed), &bad).0;
            out.sort_unstable();
            out == [bad[0].0, bad[1].0]
        });
        assert!(right.clone().count() >= 18, "{bad:?}: {}", right.count());
    }
}

#[test]
fn where_two_explain_a_miss_alike_none_goes_and_both_are_named() {
    // Two sizes of a budget beside three sound ones: either may be the bad one.
    let mut points = table(4, 7, NOISE, 3);
    points.truncate(21 + 2);
    let (out, doubts) = dropped(points.clone(), &[(22, 0.5)]);
    assert!(out.is_empty(), "{out:?}");
    let [doubt] = &doubts[..] else { panic!("{doubts:?}") };
    assert!(points[21..].iter().all(|point| doubt.contains(&point.run_id)), "{doubt}");
    assert!(doubt.contains("do not tell which"), "{doubt}");
}

#[test]
fn too_few_runs_to_judge_any_are_told() {
    let (out, doubts) = dropped(table(1, 4, NOISE, 0), &[(1, 0.5)]);
    assert!(out.is_empty() && doubts[0].contains("judges no run"), "{doubts:?}");
}

#[test]
fn the_order_of_rows_and_the_unit_of_the_loss_change_nothing() {
    let bad = [(0, 0.4), (16, 0.5), (17, 0.3)];
    let mut points = table(5, 7, NOISE, 5);
    bad.iter().for_each(|(row, by)| points[*row].loss += by);
    let names = |points: Vec<IsoFlopPoint>| {
        let dropped = OutlierStage::Spline.split(points).dropped;
        let mut names: Vec<String> = dropped.into_iter().map(|(point, _)| point.run_id).collect();
        names.sort_unstable();
        names
    };
    let own = names(points.clone());
    assert_eq!(own.len(), 3);
    assert_eq!(names(points.iter().rev().cloned().collect()), own);
    let other =
        |point: &IsoFlopPoint| IsoFlopPoint { loss: 1e3 + 1e3 * point.loss, ..point.clone() };
    assert_eq!(names(points.iter().map(other).collect()), own);
}
