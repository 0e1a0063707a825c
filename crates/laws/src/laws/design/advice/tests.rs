use super::*;
use crate::laws::fit::fit;
use crate::laws::input::options::FitOptions;
use crate::laws::input::point::IsoFlopPoint;
use crate::laws::simulated::{SWEEP, Simulated};

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
