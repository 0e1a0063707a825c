//! Laws of simulated sweeps, whose truth is known.

mod degenerate;
mod parametric_laws;

use super::*;
use crate::laws::input::Weights;
use crate::laws::lines::{PowerLaw, PowerLaws, power_law};
use crate::laws::minima::MinimumFlag;
use crate::laws::simulated::{SURFACE, Simulated, point};
use crate::laws::slices;

const BUDGETS: [f64; 6] = [1e15, 3e15, 1e16, 3e16, 1e17, 3e17];
const VOCABULARIES: [f64; 9] =
    [1024.0, 2048.0, 4096.0, 8192.0, 16384.0, 32768.0, 65536.0, 131072.0, 262144.0];

pub fn simulated() -> Simulated<'static> {
    Simulated {
        budgets: &BUDGETS,
        n_sizes: 7,
        off_centre: 0.1,
        vocabularies: &VOCABULARIES,
        n_seeds: 1,
        noise: 0.005,
        seed: 1,
    }
}

pub fn options() -> FitOptions {
    FitOptions { bootstrap: 0, ..FitOptions::default() }
}

/// The exponents in C of the true optima of the fitted budgets: N_nv, N_v, D.
pub fn true_exponents() -> [f64; 3] {
    let optima: Vec<(f64, f64)> = BUDGETS.iter().map(|c| SURFACE.optimum(*c)).collect();
    let exponent = |ln_y: &dyn Fn(usize) -> f64| {
        let y: Vec<f64> = (0..6).map(|i| ln_y(i).exp()).collect();
        power_law(&BUDGETS, &y, 1e16, &[1.0; 6], None).unwrap().exponent
    };
    let total = |i: usize| (optima[i].0.exp() + optima[i].1.exp()).ln();
    [
        exponent(&|i| optima[i].0),
        exponent(&|i| optima[i].1),
        exponent(&|i| BUDGETS[i].ln() - 6f64.ln() - total(i)),
    ]
}

fn exponents(laws: &Laws) -> [f64; 3] {
    let laws = &laws.power_laws;
    [&laws.params_nonvocab, &laws.params_vocab, &laws.tokens]
        .map(|law| law.as_ref().unwrap().exponent)
}

#[test]
fn known_exponents_are_recovered_without_noise() {
    let points = Simulated { noise: 0.0, ..simulated() }.points();
    for (method, near) in [
        (MinimumMethod::Argmin, 0.04),
        (MinimumMethod::Parabola, 0.005),
        (MinimumMethod::Cubic, 0.005),
        (MinimumMethod::Surface, 0.01),
    ] {
        let laws = fit(&points, &FitOptions { law_method: Some(method), ..options() }).unwrap();
        assert_eq!(laws.minima_method, method);
        for (found, truth) in exponents(&laws).into_iter().zip(true_exponents()) {
            assert!((found - truth).abs() < near, "{method}: {found} for {truth}");
        }
    }
}

#[test]
fn the_intervals_hold_the_true_exponents_of_a_noisy_sweep() {
    for n_seeds in [1, 3] {
        let points = Simulated { n_seeds, noise: 0.01, ..simulated() }.points();
        let laws = fit(&points, &FitOptions { bootstrap: 200, ..options() }).unwrap();
        assert_eq!(laws.bootstrap.len(), 200);
        let fitted = &laws.power_laws;
        let fitted = [&fitted.params_nonvocab, &fitted.params_vocab, &fitted.tokens];
        for (law, truth) in fitted.into_iter().zip(true_exponents()) {
            let [low, high] = law.as_ref().unwrap().exponent_ci95.unwrap();
            assert!(low < truth && truth < high, "{truth} not in {low}..{high}");
            assert!(high - low < 0.5 * truth, "{low}..{high} says nothing");
        }
        let [_, vocab, _] = true_exponents();
        let gamma = laws.vocab_from_nonvocab.unwrap().exponent_ci95.unwrap();
        let truth = vocab / true_exponents()[0];
        assert!(gamma[0] < truth && truth < gamma[1], "{truth} not in {gamma:?}");
    }
}

#[test]
fn the_laws_do_not_depend_on_the_number_of_threads() {
    let points = simulated().points();
    let with_threads = |n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| fit(&points, &FitOptions { bootstrap: 60, ..options() }).unwrap())
    };
    let laws = with_threads(1);
    assert_eq!(laws, with_threads(4));
    let reseeded = fit(&points, &FitOptions { bootstrap: 60, seed: 1, ..options() }).unwrap();
    assert_ne!(laws.bootstrap, reseeded.bootstrap);
}

#[test]
fn laws_are_of_all_budgets_and_tested_by_those_without_the_held_out_one() {
    let points = simulated().points();
    let laws = fit(&points, &options()).unwrap();
    let held_out = laws.held_out.as_ref().unwrap();
    assert_eq!((held_out.budget_flops, &laws.fitted_budgets[..]), (3e17, &BUDGETS[..]));
    let smaller: Vec<IsoFlopPoint> =
        points.iter().filter(|p| p.budget_flops < 3e17).cloned().collect();
    let without = fit(&smaller, &FitOptions { hold_out: HoldOut::None, ..options() }).unwrap();
    let [size, vocab, tokens] = exponents(&without);
    let own = held_out.exponents;
    assert_eq!([own.size, own.params_vocab, own.tokens], [size, vocab, tokens].map(Some));
    let predicted = without.loss.floor.unwrap().loss_at(3e17, without.reference_flops);
    let error = laws.loss.floor.unwrap().held_out_error.unwrap();
    assert!((predicted - held_out.minimum.loss_normalised - error).abs() < 1e-9, "{error}");
}

#[test]
fn a_loss_with_a_floor_is_predicted_better_by_the_floor_law() {
    let laws = fit(&simulated().points(), &options()).unwrap();
    let (log, floor) = (laws.loss.log.unwrap(), laws.loss.floor.unwrap());
    assert!(floor.held_out_error.unwrap().abs() < log.held_out_error.unwrap().abs());
    assert!(floor.aic < log.aic);
    assert!((floor.floor - SURFACE.floor).abs() < 0.3, "{}", floor.floor);
}

#[test]
fn a_budget_can_be_held_out_by_name_or_not_at_all() {
    let points = simulated().points();
    let held_out = |hold_out| fit(&points, &FitOptions { hold_out, ..options() });
    let middle = held_out(HoldOut::Budget(1e16 * (1.0 + 1e-12))).unwrap();
    assert_eq!(middle.held_out.unwrap().budget_flops, 1e16);
    let none = held_out(HoldOut::None).unwrap();
    assert_eq!((none.fitted_budgets.len(), none.held_out), (6, None));
    let absent = held_out(HoldOut::Budget(2e16)).unwrap_err();
    assert!(!absent.is_unidentifiable());
    assert!(absent.to_string().contains("1e15, 3e15"), "{absent}");
}

#[test]
fn flagged_minima_are_left_out_and_named_unless_they_are_kept() {
    let mut points = simulated().points();
    let sizes = |p: &IsoFlopPoint| p.budget_flops != 3e15 || p.params_nonvocab > 2.5e7;
    points.retain(sizes);
    let laws = fit(&points, &options()).unwrap();
    assert_eq!(laws.fitted_budgets, [1e15, 1e16, 3e16, 1e17, 3e17]);
    assert_eq!(laws.power_laws.tokens.as_ref().unwrap().n, 5);
    let named = |sentences: &[String]| sentences.iter().any(|s| s.contains("3e15"));
    assert!(named(&laws.warnings), "{:?}", laws.warnings);
    let flagged = laws.minima.iter().find(|m| m.budget_flops == 3e15).unwrap();
    assert!(flagged.flags.contains(&MinimumFlag::NotBracketed));
    let kept = fit(&points, &FitOptions { keep_flagged: true, ..options() }).unwrap();
    assert_eq!(kept.fitted_budgets.len(), 6);
    assert!(named(&kept.warnings));
    let row = |laws: &Laws| laws.sensitivity.iter().any(|r| r.variant.contains("flagged kept"));
    assert!(row(&laws) && !row(&kept));
}

#[test]
fn the_argmin_stands_in_for_parabolas_that_are_flagged_and_says_so() {
    let mut points = simulated().points();
    // Downward curves around one good run in the middle: an argmin, but no parabola.
    for p in points.iter_mut().filter(|p| p.budget_flops < 1e17) {
        let (best, _) = SURFACE.optimum(p.budget_flops);
        let off = p.params_nonvocab.ln() - best - 0.1;
        let lowest = if off.abs() < 0.1 { 0.35 } else { 0.0 };
        p.loss -= 2.0 * lowest + 0.25 * off * off;
    }
    let laws = fit(&points, &FitOptions { keep_flagged: false, ..options() });
    let laws = laws.unwrap();
    assert_eq!(laws.minima_method, MinimumMethod::Argmin);
    assert!(laws.warnings.iter().any(|s| s.contains("unflagged parabola")), "{:?}", laws.warnings);
}

#[test]
fn one_vocabulary_leaves_the_vocabulary_laws_out_and_says_so() {
    let points = Simulated { vocabularies: &[16384.0], ..simulated() }.points();
    let laws = fit(&points, &FitOptions { bootstrap: 50, ..options() }).unwrap();
    assert_eq!((&laws.power_laws.params_vocab, &laws.vocab_from_nonvocab), (&None, &None));
    assert!(laws.power_laws.params_nonvocab.is_some());
    assert!(laws.warnings.iter().any(|s| s.contains("one vocabulary only")));
    assert!(laws.sensitivity.iter().all(|row| row.exponent_vocab.is_none()));
    let text = serde_json::to_string(&laws).unwrap();
    assert_eq!(serde_json::from_str::<Laws>(&text).unwrap(), laws);
}

/// The points as a table that gives N alone.
fn without_vocabulary(points: Vec<IsoFlopPoint>) -> Vec<IsoFlopPoint> {
    let total = |p: IsoFlopPoint| IsoFlopPoint {
        params_nonvocab: p.params_nonvocab + p.params_vocab,
        params_vocab: 0.0,
        n_vocab: 0.0,
        ..p
    };
    points.into_iter().map(total).collect()
}

#[test]
fn a_table_of_n_alone_gives_a_law_of_n() {
    let points = without_vocabulary(Simulated { vocabularies: &[16384.0], ..simulated() }.points());
    let options = FitOptions {
        parameters: Parameters::Total,
        bootstrap: 50,
        methods: vec![MinimumMethod::Parabola, MinimumMethod::Akima, MinimumMethod::Surface],
        ..options()
    };
    let laws = fit(&points, &options).unwrap();
    let PowerLaws { params, params_vocab, params_nonvocab, tokens, .. } = &laws.power_laws;
    assert_eq!((params_vocab, params_nonvocab, &laws.vocab_from_nonvocab), (&None, &None, &None));
    let (n, d) = (params.as_ref().unwrap(), tokens.as_ref().unwrap());
    assert!((n.exponent + d.exponent - 1.0).abs() < 1e-9, "6ND = C");
    assert!(laws.minima.iter().all(|m| (m.params_vocab, m.n_vocab) == (0.0, 0.0)));
    assert!(!laws.warnings.iter().any(|s| s.contains("vocabulary")), "{:?}", laws.warnings);
    let text = serde_json::to_string(&laws).unwrap();
    assert_eq!(serde_json::from_str::<Laws>(&text).unwrap(), laws);
    let said = format!("{:?}", laws.answer());
    assert!(!said.contains("N_nv") && !said.contains("NaN"), "{said}");
    let kept = FitOptions { keep_flagged: true, spend_budget: true, ..options };
    assert!(fit(&points, &kept).unwrap().power_laws.params.is_some());
}

#[test]
fn a_vocabulary_must_be_there_or_not_as_the_options_say() {
    let split = simulated().points();
    let total = without_vocabulary(split.clone());
    let of_total = FitOptions { parameters: Parameters::Total, ..options() };
    for (points, options) in [(&split, &of_total), (&total, &options())] {
        let error = fit(points, options).unwrap_err();
        assert!(matches!(error, FitError::BadValue { field: "params_vocab", .. }), "{error}");
    }
    let surface = FitOptions { law_method: Some(MinimumMethod::Surface), ..of_total };
    let error = fit(&total, &surface).unwrap_err();
    assert!(error.to_string().contains("one number of parameters"), "{error}");
}

#[test]
fn laws_survive_their_file_and_have_the_documented_keys() {
    let laws = fit(&simulated().points(), &FitOptions { bootstrap: 50, ..options() }).unwrap();
    let json = serde_json::to_value(&laws).unwrap();
    for key in [
        "/flops_rule",
        "/minima/0/flags",
        "/power_laws/params_vocab/exponent_ci95/1",
        "/power_laws/tokens/r2",
        "/vocab_from_nonvocab/log10_coefficient",
        "/loss/log/held_out_error",
        "/loss/floor/coefficient",
        "/loss/floor/floor_ci95/0",
        "/loss/floor/coefficient_ci95/0",
        "/loss/floor/exponent_ci95/1",
        "/loss/log/intercept_ci95/0",
        "/power_laws/tokens/ln_at_reference_ci95/0",
        "/power_laws/tokens/log10_coefficient_ci95/0",
        "/minima/0/ci95/params_nonvocab/0",
        "/minima/0/ci95/params_vocab/0",
        "/minima/0/ci95/loss_normalised/0",
        "/noise/sd",
        "/bootstrap/0/floor/exponent",
        "/validation/0/log_error",
        "/advice/0/why",
        "/sensitivity/0/variant",
    ] {
        assert!(json.pointer(key).is_some_and(|value| !value.is_null()), "{key}");
    }
    assert_eq!(serde_json::from_str::<Laws>(&json.to_string()).unwrap(), laws);
}

// Intervals, weights and counts of FLOPs.

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
