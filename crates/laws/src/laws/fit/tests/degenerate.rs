//! Degenerate tables and options: a clear message or the right answer, never a silent number.

use super::*;
use crate::laws::file::AdviceKind;
use crate::laws::maths::stats::Normals;

#[test]
fn an_empty_table_is_refused() {
    let error = fit(&[], &options()).unwrap_err();
    assert_eq!(error, FitError::NoPoints);
    assert!(error.is_unidentifiable());
}

#[test]
fn a_bad_value_names_its_run_and_field() {
    for (field, value) in [("loss_normalised", f64::NAN), ("tokens", 0.0), ("flops", f64::INFINITY)]
    {
        let mut points = simulated().points();
        match field {
            "tokens" => points[7].tokens = value,
            "flops" => points[7].flops = value,
            _ => points[7].loss = value,
        }
        let error = fit(&points, &options()).unwrap_err();
        assert!(!error.is_unidentifiable());
        let message = error.to_string();
        assert!(message.contains(field) && message.contains(&points[7].run_id), "{message}");
    }
}

#[test]
fn one_budget_identifies_no_law() {
    let points = Simulated { budgets: &[1e16], ..simulated() }.points();
    let error = fit(&points, &options()).unwrap_err();
    assert_eq!(error, FitError::TooFewBudgets { found: 1 });
    assert!(error.is_unidentifiable());
}

#[test]
fn two_budgets_are_fitted_without_holding_one_out() {
    let points = Simulated { budgets: &[1e15, 1e16], ..simulated() }.points();
    let laws = fit(&points, &options()).unwrap();
    assert_eq!((laws.fitted_budgets.len(), &laws.held_out), (2, &None));
    assert_eq!(
        (&laws.power_laws.params_nonvocab, &laws.loss.log),
        (&None, &None),
        "a line through two"
    );
    assert!(laws.answer().exponents.params_nonvocab.unwrap().value.is_some(), "by all cells");
    assert!(laws.warnings.iter().any(|s| s.contains("none is held out")));
    assert_eq!(laws.loss.floor, None);
    let named = FitOptions { hold_out: HoldOut::Budget(1e16), ..options() };
    assert_eq!(fit(&points, &named), Err(FitError::TooFewBudgets { found: 1 }));
}

#[test]
fn two_sizes_a_budget_have_no_minima_but_all_cells_together_may_tell_the_optimum() {
    let points = Simulated { n_sizes: 2, ..simulated() }.points();
    let laws = fit(&points, &options()).unwrap();
    assert_eq!(laws.power_laws.params_nonvocab, None);
    assert!(laws.warnings.iter().any(|warning| warning.contains("few-levels")));
    let own = laws.answer().exponents.params_nonvocab.unwrap().value.unwrap();
    assert!((own - true_exponents()[0]).abs() < 0.1, "{own}");
}

#[test]
fn identical_rows_identify_no_law_and_are_named() {
    let same: Vec<_> = (0..12).map(|_| point(1e6, 6400.0, -2.0, 0)).collect();
    assert_eq!(fit(&same, &options()), Err(FitError::TooFewBudgets { found: 1 }));
    let other: Vec<_> =
        same.iter().map(|p| IsoFlopPoint { budget_flops: 1e13, ..p.clone() }).collect();
    let both = [same, other].concat();
    assert!(fit(&both, &options()).unwrap_err().is_unidentifiable());
    let kept = fit(&both, &FitOptions { keep_flagged: true, bootstrap: 50, ..options() }).unwrap();
    assert!(kept.warnings.iter().any(|s| s.contains("several runs of one seed")));
    assert!(kept.answer().exponents.is_undetermined(), "{:?}", kept.answer());
}

#[test]
fn a_huber_delta_must_be_a_positive_number() {
    for huber in [0.0, -1.0, f64::NAN] {
        let error = fit(&simulated().points(), &FitOptions { huber: Some(huber), ..options() });
        assert!(matches!(error, Err(FitError::BadOption { option: "huber", .. })));
    }
}

#[test]
fn a_best_cell_that_lost_a_run_is_told_of() {
    let mut points = Simulated { n_seeds: 2, ..simulated() }.points();
    let told = |points: &[IsoFlopPoint]| {
        let laws = fit(points, &options()).unwrap();
        laws.warnings.into_iter().find(|warning| warning.contains("biased low"))
    };
    assert_eq!(told(&points), None);
    // Of the best cell the worse run is lost, as by divergence.
    let best = points.iter().min_by(|a, b| a.loss.total_cmp(&b.loss)).unwrap().clone();
    let is_beside = |point: &IsoFlopPoint| {
        point.budget_flops == best.budget_flops
            && point.params_nonvocab == best.params_nonvocab
            && point.n_vocab == best.n_vocab
            && point.run_id != best.run_id
    };
    points.retain(|point| !is_beside(point));
    let sentence = told(&points).expect("a sentence");
    assert!(sentence.starts_with("1 cell(s)"), "{sentence}");
    // A cell that is not the best of its size may lose one.
    let mut points = Simulated { n_seeds: 2, ..simulated() }.points();
    let worst = points.iter().max_by(|a, b| a.loss.total_cmp(&b.loss)).unwrap().clone();
    points.retain(|point| point.run_id != worst.run_id);
    assert_eq!(told(&points), None);
}

#[test]
fn runs_that_spend_unequal_shares_of_their_budget_are_told_of() {
    let told = |points: &[IsoFlopPoint]| {
        let doubts = fit(points, &options()).unwrap().answer().doubts;
        doubts.into_iter().find(|doubt| doubt.what.contains("spend")).map(|doubt| doubt.what)
    };
    let mut points = simulated().points();
    assert_eq!(told(&points), None);
    let smallest = points.iter().map(|p| p.params_nonvocab).fold(f64::INFINITY, f64::min);
    for point in points.iter_mut().filter(|p| p.params_nonvocab < 1.5 * smallest) {
        point.flops *= 1.54;
    }
    let sentence = told(&points).expect("a doubt");
    assert!(sentence.contains("spend 1.00 to 1.54 of it"), "{sentence}");
}

/// The same runs, whose losses depend on N_nv and D and, if asked for, on V.
fn with_or_without_vocabulary(points: &[IsoFlopPoint], with: bool) -> Vec<IsoFlopPoint> {
    let mut normals = Normals::of_stream(9, 1);
    let mut loss = |p: &IsoFlopPoint| {
        let params_vocab = if with { p.params_vocab } else { 1e6 };
        SURFACE.loss(p.params_nonvocab, params_vocab, p.tokens) + 0.003 * normals.draw()
    };
    points.iter().map(|point| IsoFlopPoint { loss: loss(point), ..point.clone() }).collect()
}

#[test]
fn losses_that_do_not_depend_on_the_vocabulary_tell_no_exponent_of_it_by_any_approach() {
    let parametric =
        ParametricOptions { bootstrap: 20, ..ParametricOptions::of(Form::Approach3Vocab) };
    for with_vocab in [false, true] {
        let points = with_or_without_vocabulary(&simulated().points(), with_vocab);
        let own = fit_parametric(&points, &parametric).unwrap();
        let all = [
            fit(&points, &options()).unwrap(),
            approach1(&points, &options()).unwrap(),
            parametric_laws(&points, own, "t", "6nd"),
        ];
        for laws in all {
            let told = laws.answer().exponents;
            let vocab = told.params_vocab.unwrap();
            assert_eq!(laws.judgement.vocab_is_chance, !with_vocab, "{vocab:?}");
            assert!(with_vocab || (vocab.value.is_none() && vocab.reason.is_some()), "{vocab:?}");
            assert!(told.params_nonvocab.unwrap().value.is_some());
        }
    }
}

const SWEEP: Simulated = Simulated {
    budgets: &[1e15, 1e16, 1e17],
    n_sizes: 5,
    off_centre: 0.1,
    vocabularies: &[2500.0, 7500.0, 22500.0, 67500.0, 202500.0],
    n_seeds: 1,
    noise: 0.003,
    seed: 5,
};

fn with_replicates() -> FitOptions {
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
    let laws = laws(&points, &with_replicates());
    assert!(has_no_intervals(&laws));
    assert!(warned(&laws, "no more than rounding").is_some(), "{:?}", laws.warnings);
}

#[test]
fn too_few_runs_to_know_the_noise_have_no_intervals_and_a_warning() {
    let points = Simulated { n_sizes: 3, vocabularies: &[7500.0], ..SWEEP }.points();
    let laws = laws(&points, &FitOptions { keep_flagged: true, ..with_replicates() });
    assert!(has_no_intervals(&laws) && laws.noise.is_none());
    assert!(warned(&laws, "second seed").is_some(), "{:?}", laws.warnings);
    let quiet = fit(&points, &FitOptions { keep_flagged: true, bootstrap: 0, ..with_replicates() });
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
    let laws = laws(&points, &with_replicates());
    assert_eq!(laws.fitted_budgets, [1e15, 1e17]);
    let cell = laws.minima.iter().find(|m| m.budget_flops == 1e16).unwrap();
    assert!(cell.flags.contains(&MinimumFlag::FewLevels) && cell.ci95.is_none());
    let advice = laws.advice.iter().find(|advice| advice.budget_flops == 1e16).unwrap();
    assert_eq!((advice.kind, advice.params_nonvocab.len()), (AdviceKind::AddSizes, 4));
}

#[test]
fn two_vocabularies_may_be_kept_with_finite_numbers() {
    let points = Simulated { vocabularies: &[7500.0, 22500.0], ..SWEEP }.points();
    let laws = laws(&points, &FitOptions { keep_flagged: true, ..with_replicates() });
    assert!(laws.power_laws.params_nonvocab.is_some());
}

#[test]
fn losses_that_are_all_equal_identify_nothing() {
    let mut points = SWEEP.points();
    points.iter_mut().for_each(|p| p.loss = -2.0);
    assert!(fit(&points, &with_replicates()).unwrap_err().is_unidentifiable());
    let kept = laws(&points, &FitOptions { keep_flagged: true, ..with_replicates() });
    assert!(has_no_intervals(&kept) && kept.loss.floor.is_none());
    assert!(kept.answer().exponents.is_undetermined(), "{:?}", kept.answer());
}

#[test]
fn losses_that_are_noise_within_each_budget_give_no_law_unless_flagged_minima_are_asked_for() {
    let kept = FitOptions { keep_flagged: true, ..options() };
    let said = |points: &[IsoFlopPoint]| {
        let rows = fit(points, &kept).unwrap().judgement.rows;
        rows.iter().any(|row| row.contains("they tell no optimum"))
    };
    let mut points = simulated().points();
    assert!(fit(&points, &options()).is_ok() && !said(&points));
    for per_budget in [-0.1, 0.0] {
        let mut normals = Normals::of_stream(3, 0);
        points.iter_mut().for_each(|point| {
            point.loss = 3.0 + per_budget * point.budget_flops.ln() + 0.001 * normals.draw();
        });
        let error = fit(&points, &options()).unwrap_err();
        assert!(error.is_unidentifiable() && error.to_string().contains("holds no law"), "{error}");
    }
    assert!(said(&points));
}

#[test]
fn a_run_without_weight_is_refused() {
    for weight in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let mut points = SWEEP.points();
        points[3].weight = weight;
        let error = fit(&points, &with_replicates()).unwrap_err();
        assert!(matches!(error, FitError::BadValue { field: "weight", .. }), "{error}");
    }
}

#[test]
fn the_weights_unit_does_not_matter() {
    let points = Simulated { n_seeds: 2, ..SWEEP }.points();
    let heavier: Vec<_> =
        points.iter().map(|p| IsoFlopPoint { weight: 4.0, ..p.clone() }).collect();
    assert_eq!(laws(&points, &with_replicates()), laws(&heavier, &with_replicates()));
}

#[test]
fn a_million_rows_are_fitted_like_the_few_cells_they_are() {
    let points = Simulated { n_seeds: 1_000_000 / 75, noise: 0.01, ..SWEEP }.points();
    let laws = fit(&points, &with_replicates()).unwrap();
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
