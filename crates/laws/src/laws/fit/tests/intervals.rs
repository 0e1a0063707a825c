//! Intervals, weights and counts of FLOPs.

use super::*;

#[test]
fn hubers_laws_resist_one_spoiled_budget() {
    let mut points = simulated().points();
    for p in points.iter_mut().filter(|p| p.budget_flops == 1e17) {
        p.params_nonvocab *= 8.0;
    }
    let miss = |huber| {
        let laws = fit(&points, &FitOptions { huber, ..options() }).unwrap();
        (exponents(&laws)[0] - true_exponents()[0]).abs()
    };
    assert!(miss(Some(1.345)) < 0.05 && miss(None) > 0.1, "{} {}", miss(Some(1.345)), miss(None));
}

#[test]
fn every_interval_holds_its_own_estimate() {
    let laws = fit(&simulated().points(), &FitOptions { bootstrap: 200, ..options() }).unwrap();
    let holds = |value: f64, interval: Option<[f64; 2]>| {
        let [low, high] = interval.unwrap();
        assert!(low < value && value < high, "{value} not in {low}..{high}");
    };
    let of = &laws.power_laws;
    for law in [&of.params_nonvocab, &of.params_vocab, &of.tokens] {
        let law = law.as_ref().unwrap();
        holds(law.exponent, law.exponent_ci95);
        holds(law.ln_at_reference, law.ln_at_reference_ci95);
        holds(law.log10_coefficient, law.log10_coefficient_ci95);
    }
    let floor = laws.loss.floor.as_ref().unwrap();
    holds(floor.floor, floor.floor_ci95);
    holds(floor.exponent, floor.exponent_ci95);
    for m in laws.minima.iter().filter(|m| m.method == MinimumMethod::Parabola) {
        let ci95 = m.ci95.unwrap();
        holds(m.params_nonvocab, ci95.params_nonvocab);
        holds(m.params_vocab, ci95.params_vocab);
        holds(m.loss_normalised, ci95.loss_normalised);
    }
}

#[test]
fn a_budget_of_more_runs_weighs_more_when_asked() {
    let mut points = simulated().points();
    points.retain(|p| p.budget_flops != 1e17 || p.n_vocab > 8000.0);
    let weighted = |weights| fit(&points, &FitOptions { weights, ..options() }).unwrap();
    assert_ne!(exponents(&weighted(Weights::Runs)), exponents(&weighted(Weights::Equal)));
}

#[test]
fn constrained_laws_spend_the_budget_to_first_order() {
    let options = FitOptions { spend_budget: true, ..options() };
    let laws = fit(&simulated().points(), &options).unwrap();
    let at = |law: &Option<PowerLaw>, c: f64| law.as_ref().unwrap().value_at(c);
    let ratio = |c: f64| {
        let laws = &laws.power_laws;
        6.0 * (at(&laws.params_nonvocab, c) + at(&laws.params_vocab, c)) * at(&laws.tokens, c) / c
    };
    let c0 = laws.reference_flops;
    assert!((ratio(c0) - 1.0).abs() < 1e-9, "{}", ratio(c0));
    // The second-order term alone is left: it shrinks with the square of the step in ln C.
    let (far, near) = ((ratio(c0 * 10.0) - 1.0).abs(), (ratio(c0 * 1.1) - 1.0).abs());
    assert!(far < 0.01 && near < far / 200.0, "{far} {near}");
}

#[test]
fn another_flop_rule_is_fitted_in_what_the_runs_spent() {
    let mut points = simulated().points();
    points.iter_mut().for_each(|p| p.flops = p.budget_flops.powf(1.1));
    let declared = fit(&points, &options()).unwrap();
    assert!(declared.warnings.iter().any(|s| s.contains("declared")), "{:?}", declared.warnings);
    let moved: Vec<_> = slices(&points).unwrap().points.into_iter().flatten().collect();
    assert_eq!(moved.len(), points.len());
    let achieved = fit(&moved, &options()).unwrap();
    for (there, here) in exponents(&achieved).into_iter().zip(exponents(&declared)) {
        assert!((there - here / 1.1).abs() < 1e-9);
    }
    let row = sensitivity_row("flops: 6nd", &achieved);
    assert_eq!(row.exponent_tokens, Some(exponents(&achieved)[2]));
}
