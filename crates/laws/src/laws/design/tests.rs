//! Choices of runs on a grid of known losses.

use super::*;
use crate::laws::input::point::RunFacts;
use crate::laws::simulated::{SWEEP, Simulated};

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
        let best = at(&all, budget).into_iter().min_by(|a, b| a.loss.total_cmp(&b.loss)).unwrap();
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
    let smallest = at(&left, 1e16).iter().map(|p| p.params_nonvocab).fold(f64::INFINITY, f64::min);
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
