use super::*;
use crate::laws::fit::parametric_laws::fit_parametric;
use crate::laws::fit::parametric_laws::parametric_laws;
use crate::laws::input::error::FitError;
use crate::laws::parametric::form::Form;
use crate::laws::parametric::objective::Space;
use crate::laws::parametric::options::{Huber, ParametricOptions};
use crate::laws::parametric::types::Parametric;

fn fit(runs: &[IsoFlopPoint]) -> Result<Parametric, FitError> {
    fit_parametric(
        runs,
        &ParametricOptions { bootstrap: 50, ..ParametricOptions::of(Form::Approach3) },
    )
}

fn not_identified(runs: &[IsoFlopPoint], word: &str) {
    let error = fit(runs).unwrap_err();
    assert!(error.is_unidentifiable(), "{error}");
    assert!(error.to_string().contains(word), "{error}");
}

#[test]
fn tables_that_tell_too_little_are_refused_with_the_reason() {
    let runs = chinchilla_runs(5, 0.01, 0);
    assert_eq!(fit(&[]).unwrap_err(), FitError::NoPoints);
    not_identified(&runs[..5], "5 rows");
    not_identified(&vec![runs[0].clone(); 10], "the same in every row");
    let one_size = |p: &IsoFlopPoint| IsoFlopPoint { params_nonvocab: 1e9, ..p.clone() };
    not_identified(&runs.iter().map(one_size).collect::<Vec<_>>(), "N is the same");
    let two_sizes = |p: &IsoFlopPoint| IsoFlopPoint {
        params_nonvocab: if p.params_nonvocab > 1e9 { 2e9 } else { 1e9 },
        ..p.clone()
    };
    not_identified(&runs.iter().map(two_sizes).collect::<Vec<_>>(), "N has 2 different values");
    let one_diet =
        |p: &IsoFlopPoint| IsoFlopPoint { tokens: 20.0 * p.params_nonvocab, ..p.clone() };
    not_identified(&runs.iter().map(one_diet).collect::<Vec<_>>(), "rise and fall together");
}

#[test]
fn a_value_that_no_law_can_use_names_its_run() {
    type Spoil = fn(&mut IsoFlopPoint);
    let spoils: [(Spoil, &str); 5] = [
        (|p| p.loss = f64::NAN, "loss"),
        (|p| p.loss = -1.0, "loss"),
        (|p| p.tokens = 0.0, "D"),
        (|p| p.params_nonvocab = f64::INFINITY, "N"),
        (|p| p.weight = -1.0, "weight"),
    ];
    for (spoil, field) in spoils {
        let mut runs = chinchilla_runs(5, 0.01, 0);
        spoil(&mut runs[7]);
        let error = fit(&runs).unwrap_err();
        assert!(!error.is_unidentifiable());
        let message = error.to_string();
        assert!(message.contains(&runs[7].run_id) && message.contains(field), "{message}");
    }
}

#[test]
fn a_negative_loss_is_fitted_as_it_is_but_not_in_logarithms() {
    let runs = motion_runs(0.01, 0);
    let options = without_intervals(Form::Approach3Vocab);
    assert!(runs.iter().any(|p| p.loss < 0.0));
    assert!(fit_parametric(&runs, &options).is_ok());
    let log = ParametricOptions { space: Space::Log, ..options };
    assert!(fit_parametric(&runs, &log).unwrap_err().to_string().contains("above 0"));
}

#[test]
fn a_loss_that_does_not_fall_with_a_quantity_says_so() {
    let mut runs = chinchilla_runs(7, 0.0, 0);
    for run in &mut runs {
        run.loss = 2.0 + 300.0 * run.tokens.powf(-0.3);
    }
    let fit = fit(&runs).unwrap();
    assert!(fit.warnings.iter().any(|w| w.contains("of N is not identified")), "{fit:?}");
    let laws = parametric_laws(&runs, fit, "flat", "6nd");
    let doubts = laws.answer().doubts;
    assert!(doubts.iter().any(|doubt| doubt.what.contains("of N is not identified")));
    // No loss at all to explain.
    runs.iter_mut().for_each(|run| run.loss = 2.0);
    let flat = fit_parametric(&runs, &without_intervals(Form::Approach3)).unwrap();
    assert!(!flat.warnings.is_empty(), "{flat:?}");
}

#[test]
fn hubers_delta_must_be_a_positive_number() {
    for huber in [Huber::Delta(0.0), Huber::Delta(f64::NAN), Huber::Mad(-1.0)] {
        let options = ParametricOptions { huber, ..ParametricOptions::of(Form::Approach3) };
        let error = fit_parametric(&chinchilla_runs(5, 0.01, 0), &options).unwrap_err();
        assert!(matches!(error, FitError::BadOption { option: "huber", .. }));
    }
}

#[test]
fn the_fit_does_not_depend_on_the_number_of_threads() {
    let runs = chinchilla_runs(5, 0.01, 0);
    let with = |n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| fit(&runs).unwrap())
    };
    assert_eq!(with(1), with(4));
}

#[test]
fn rows_that_move_the_optimum_are_named_with_the_optimum_of_the_others() {
    let mut runs = chinchilla_runs(7, 0.003, 3);
    let fitted = |runs: &[IsoFlopPoint]| {
        let options =
            ParametricOptions { influence_at: Some(1e24), ..without_intervals(Form::Approach3) };
        fit_parametric(runs, &ParametricOptions { huber: Huber::None, ..options }).unwrap()
    };
    assert_eq!(fitted(&runs).influence, None);
    for row in [0, 1, 7] {
        runs[row].loss *= 1.25;
    }
    let fit = fitted(&runs);
    let found = fit.influence.as_ref().expect("wrong rows make the optimum hang on a few");
    assert!(found.rows.len() <= 5, "{found:?}");
    let at = |fit: &Parametric| optimum::optimum(&fit.coefficients, 1e24).unwrap().params_nonvocab;
    let rest: Vec<IsoFlopPoint> =
        runs.iter().filter(|run| !found.rows.contains(&run.run_id)).cloned().collect();
    let near = |found: f64, wanted: f64| (found / wanted).ln().abs() < 1e-3;
    assert!(near(found.params, at(&fit)) && near(found.params_without, at(&fitted(&rest))));
    assert!((found.params / found.params_without).ln().abs() > 1.2f64.ln(), "{found:?}");
    assert!(fit.warnings.iter().any(|warning| warning.contains(&found.rows[0])));
}

#[test]
fn fewer_rows_than_three_a_coefficient_are_a_warning() {
    let runs: Vec<IsoFlopPoint> = chinchilla_runs(7, 0.003, 3).into_iter().step_by(4).collect();
    let said = |runs: &[IsoFlopPoint]| {
        let fit = fit_parametric(runs, &without_intervals(Form::Approach3)).unwrap();
        fit.warnings.iter().any(|warning| warning.contains("fewer than 3 times the 5"))
    };
    assert!(said(&runs), "{} rows", runs.len());
    assert!(!said(&chinchilla_runs(7, 0.003, 3)));
}

#[test]
fn repeats_of_a_configuration_are_drawn_together_with_or_without_a_seed() {
    let once = chinchilla_runs(15, 0.01, 3);
    let ten = |seed: fn(usize) -> u64| -> Vec<IsoFlopPoint> {
        let copy = |i: usize| {
            once.iter().map(move |p| IsoFlopPoint {
                run_id: format!("{} {i}", p.run_id),
                seed: seed(i),
                ..p.clone()
            })
        };
        (0..10).flat_map(copy).collect()
    };
    let options = ParametricOptions { bootstrap: 200, ..ParametricOptions::of(Form::Approach3) };
    let intervals = |points: &[IsoFlopPoint]| fit_parametric(points, &options).unwrap().ci95;
    let own = intervals(&once);
    for copies in [ten(|_| 0), ten(|i| i as u64)] {
        for (own, copied) in own.iter().zip(intervals(&copies)) {
            let near = |i: usize| (own[i] / copied[i] - 1.0).abs() < 1e-6;
            assert!(near(0) && near(1), "{own:?} {copied:?}");
        }
    }
}

#[test]
fn starts_on_rows_without_noise_all_reach_the_optimum() {
    let found = fit_parametric(
        &chinchilla_runs(15, 0.0, 3),
        &ParametricOptions { bootstrap: 0, ..ParametricOptions::of(Form::Approach3) },
    );
    let found = found.unwrap();
    assert!(found.starts_at_optimum > found.starts / 2, "{found:?}");
    assert!(!found.warnings.iter().any(|s| s.contains("starts")), "{:?}", found.warnings);
}
