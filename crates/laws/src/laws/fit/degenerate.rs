//! Tables that tell little or nothing: a clear message or the right answer, never a silent number.

use super::*;
use crate::laws::file::advice::AdviceKind;
use crate::laws::input::options::HoldOut;
use crate::laws::minima::types::MinimumFlag;
use crate::laws::simulated::Simulated;

const SWEEP: Simulated = Simulated {
    budgets: &[1e15, 1e16, 1e17],
    n_sizes: 5,
    off_centre: 0.1,
    vocabularies: &[2500.0, 7500.0, 22500.0, 67500.0, 202500.0],
    n_seeds: 1,
    noise: 0.003,
    seed: 5,
};

fn options() -> FitOptions {
    FitOptions { bootstrap: 100, hold_out: HoldOut::None, ..FitOptions::default() }
}

/// The laws, whose answer and file must show no number that is none.
fn laws(points: &[IsoFlopPoint], options: &FitOptions) -> Laws {
    let laws = fit(points, options).unwrap();
    let text = format!("{:?}", laws.answer());
    assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
    let json = serde_json::to_string(&laws).unwrap();
    assert_eq!(serde_json::from_str::<Laws>(&json).unwrap(), laws, "a number was lost");
    laws
}

fn has_no_intervals(laws: &Laws) -> bool {
    let law = laws.power_laws.tokens.as_ref().unwrap();
    let of_laws =
        [law.exponent_ci95, law.ln_at_reference_ci95, laws.loss.log.as_ref().unwrap().slope_ci95];
    laws.bootstrap.is_empty()
        && of_laws.iter().all(Option::is_none)
        && laws.minima.iter().all(|m| m.ci95.is_none())
}

fn warned<'a>(laws: &'a Laws, words: &str) -> Option<&'a String> {
    laws.warnings.iter().find(|warning| warning.contains(words))
}

#[test]
fn runs_without_any_scatter_have_no_intervals_and_a_warning() {
    let points = Simulated { noise: 0.0, n_seeds: 3, ..SWEEP }.points();
    let laws = laws(&points, &options());
    assert!(has_no_intervals(&laws));
    assert!(warned(&laws, "no more than rounding").is_some(), "{:?}", laws.warnings);
}

#[test]
fn too_few_runs_to_know_the_noise_have_no_intervals_and_a_warning() {
    let points = Simulated { n_sizes: 3, vocabularies: &[7500.0], ..SWEEP }.points();
    let laws = laws(&points, &FitOptions { keep_flagged: true, ..options() });
    assert!(has_no_intervals(&laws) && laws.noise.is_none());
    assert!(warned(&laws, "second seed").is_some(), "{:?}", laws.warnings);
    let quiet = fit(&points, &FitOptions { keep_flagged: true, bootstrap: 0, ..options() });
    assert!(warned(&quiet.unwrap(), "second seed").is_none(), "no intervals were asked for");
}

#[test]
fn a_budget_with_one_cell_is_flagged_left_out_and_advised_upon() {
    let mut points = SWEEP.points();
    let mut kept = 0;
    points.retain(|p| {
        p.budget_flops != 1e16 || {
            kept += 1;
            kept == 1
        }
    });
    let laws = laws(&points, &options());
    assert_eq!(laws.fitted_budgets, [1e15, 1e17]);
    let cell = laws.minima.iter().find(|m| m.budget_flops == 1e16).unwrap();
    assert!(cell.flags.contains(&MinimumFlag::FewLevels) && cell.ci95.is_none());
    let advice = laws.advice.iter().find(|advice| advice.budget_flops == 1e16).unwrap();
    assert_eq!((advice.kind, advice.params_nonvocab.len()), (AdviceKind::AddSizes, 4));
}

#[test]
fn two_vocabularies_may_be_kept_with_finite_numbers() {
    let points = Simulated { vocabularies: &[7500.0, 22500.0], ..SWEEP }.points();
    let laws = laws(&points, &FitOptions { keep_flagged: true, ..options() });
    assert!(laws.power_laws.params_nonvocab.is_some());
}

#[test]
fn losses_that_are_all_equal_identify_nothing() {
    let mut points = SWEEP.points();
    points.iter_mut().for_each(|p| p.loss = -2.0);
    assert!(fit(&points, &options()).unwrap_err().is_unidentifiable());
    let kept = laws(&points, &FitOptions { keep_flagged: true, ..options() });
    assert!(has_no_intervals(&kept) && kept.loss.floor.is_none());
    assert!(kept.answer().exponents.is_undetermined(), "{:?}", kept.answer());
}

#[test]
fn a_run_without_weight_is_refused() {
    for weight in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let mut points = SWEEP.points();
        points[3].weight = weight;
        let error = fit(&points, &options()).unwrap_err();
        assert!(matches!(error, FitError::BadValue { field: "weight", .. }), "{error}");
    }
}

#[test]
fn the_weights_unit_does_not_matter() {
    let points = Simulated { n_seeds: 2, ..SWEEP }.points();
    let heavier: Vec<_> =
        points.iter().map(|p| IsoFlopPoint { weight: 4.0, ..p.clone() }).collect();
    assert_eq!(laws(&points, &options()), laws(&heavier, &options()));
}

#[test]
fn a_million_rows_are_fitted_like_the_few_cells_they_are() {
    let points = Simulated { n_seeds: 1_000_000 / 75, noise: 0.01, ..SWEEP }.points();
    let laws = fit(&points, &options()).unwrap();
    let noise = laws.noise.unwrap();
    assert!((noise.sd / 0.01 - 1.0).abs() < 0.01, "{noise:?}");
    let parts = &laws.judgement.interval_parts;
    let width = |name: &str| {
        let part = parts.iter().find(|part| part.part == name).unwrap();
        part.exponent_nonvocab.map(|[low, high]| high - low).unwrap()
    };
    assert!(width("runs") < 0.001, "{}", width("runs"));
    // So many runs know that a parabola is not the curve.
    assert!(width("misfit") > width("runs"), "{}", width("misfit"));
}
