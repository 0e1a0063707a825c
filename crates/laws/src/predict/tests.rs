//! Predictions by laws of simulated sweeps and by those of a paper.

use super::sized::Told;
use super::*;
use crate::laws::simulated::{SURFACE, SWEEP, Simulated};
use crate::laws::{
    FitOptions, Form, IsoFlopPoint, Laws, Parameters, ParametricOptions, fit, fit_parametric,
    parametric_laws, scamo,
};

const VOCABULARIES: [f64; 7] = [4096.0, 8192.0, 16384.0, 32768.0, 65536.0, 131072.0, 262144.0];

fn points(vocabularies: &[f64]) -> Vec<IsoFlopPoint> {
    Simulated { vocabularies, noise: 0.005, seed: 3, ..SWEEP }.points()
}

fn options() -> FitOptions {
    FitOptions { flops_rule: "6nd".into(), bootstrap: 200, ..FitOptions::default() }
}

fn sweep(vocabularies: &[f64]) -> Laws {
    fit(&points(vocabularies), &options()).unwrap()
}

fn near(x: f64, expected: f64, relative: f64) -> bool {
    (x / expected - 1.0).abs() < relative
}

#[test]
fn the_published_laws_overspend_1e18_and_the_projection_spends_it() {
    let prediction = predict(&scamo(), 1e18, &PredictOptions::default()).unwrap();
    assert!(near(prediction.raw.at.params_nonvocab.unwrap(), 5.5e9, 2e-3));
    assert!(near(prediction.raw.at.params_vocab.unwrap(), 1.62e8, 2e-3));
    assert!(near(prediction.raw.at.tokens.unwrap(), 4.9e7, 1e-3));
    assert!(near(prediction.budget_ratio, 1.66, 3e-3));
    assert_eq!(prediction.spends_flops, prediction.raw.spends_flops);
    assert!((prediction.loss_normalised.unwrap() + 5.277).abs() < 1e-9);
    assert!(prediction.warnings.iter().any(|s| s.contains("overspend") && s.contains("1.66")));
    let params = prediction.at.params_nonvocab.unwrap() + prediction.at.params_vocab.unwrap();
    let spent = 6.0 * params * prediction.at.tokens.unwrap();
    assert!(near(spent, 1e18, 1e-9));
    assert!(near(
        prediction.at.tokens.unwrap() / prediction.raw.at.tokens.unwrap(),
        1.66f64.powf(-0.5),
        2e-3
    ));
}

#[test]
fn a_prediction_has_the_documented_keys_and_survives_its_file() {
    let prediction = predict(&scamo(), 1e18, &PredictOptions::default()).unwrap();
    let json = serde_json::to_value(&prediction).unwrap();
    let keys: Vec<&str> = json.as_object().unwrap().keys().map(String::as_str).collect();
    let mut documented = vec![
        "budget_flops",
        "law",
        "params_nonvocab",
        "params_vocab",
        "n_vocab",
        "tokens",
        "loss_normalised",
        "ci95",
        "spends_flops",
        "budget_ratio",
        "extrapolation_factor",
        "shape",
        "warnings",
        "raw",
    ];
    documented.sort_unstable();
    assert_eq!(
        {
            let mut keys = keys;
            keys.sort_unstable();
            keys
        },
        documented
    );
    for key in ["n_layer", "n_head", "d_model", "n_vocab", "levels"] {
        assert!(json["shape"].get(key).is_some(), "{key}");
    }
    assert_eq!(serde_json::from_str::<Prediction>(&json.to_string()).unwrap(), prediction);
}

#[test]
fn the_nearest_shape_and_codebook_are_chosen() {
    let shapes = [Shape::swiglu(24, 32, 3200, 256), Shape::swiglu(8, 8, 512, 256)];
    let options = PredictOptions { shapes: &shapes, ..PredictOptions::default() };
    let prediction = predict(&scamo(), 1e18, &options).unwrap();
    let shape = prediction.shape.unwrap();
    assert_eq!((shape.n_layer, shape.d_model), (24, 3200));
    let wanted = prediction.at.params_vocab.unwrap() / 3200.0;
    assert!(near(prediction.at.n_vocab.unwrap(), wanted, 1e-12));
    let built: u32 = shape.levels.iter().product();
    assert!(near(f64::from(built), wanted, 0.02), "{built} for {wanted}");
    let small = predict(&scamo(), 1e14, &options).unwrap().shape.unwrap();
    assert_eq!(small.d_model, 512);
}

#[test]
fn the_true_optimum_beyond_the_sweep_lies_within_the_intervals() {
    let laws = sweep(&VOCABULARIES);
    let prediction = predict(&laws, 1e18, &PredictOptions::default()).unwrap();
    let (ln_nonvocab, ln_vocab) = SURFACE.optimum(1e18);
    let (nonvocab, vocab) = (ln_nonvocab.exp(), ln_vocab.exp());
    let tokens = 1e18 / (6.0 * (nonvocab + vocab));
    let ci = prediction.ci95;
    for (interval, truth, value) in [
        (ci.at.params_nonvocab, nonvocab, prediction.at.params_nonvocab.unwrap()),
        (ci.at.params_vocab, vocab, prediction.at.params_vocab.unwrap()),
        (ci.at.tokens, tokens, prediction.at.tokens.unwrap()),
    ] {
        let [low, high] = interval.unwrap();
        assert!(low < truth && truth < high, "{truth} not in {low}..{high}");
        assert!(low < value && value < high, "{value} not in {low}..{high}");
    }
    assert!(ci.at.n_vocab.is_some() && ci.loss_normalised.is_some() && ci.loss_floor.is_some());
    // 1e17 is held out of the laws, but not of what a prediction reads.
    assert!(near(prediction.extrapolation_factor, 10.0, 1e-12));
}

#[test]
fn one_vocabulary_is_kept_in_the_prediction() {
    let laws = sweep(&[16384.0]);
    let prediction = predict(&laws, 1e17, &PredictOptions::default()).unwrap();
    // Simulated models are (64 N_nv/12)^(1/3) wide.
    let width = (prediction.raw.at.params_nonvocab.unwrap() * 64.0 / 12.0).cbrt();
    assert!(near(prediction.raw.at.params_vocab.unwrap(), 16384.0 * width, 0.1));
    assert!(prediction.warnings.iter().any(|s| s.contains("one vocabulary")));
}

#[test]
fn a_loss_outside_its_own_interval_is_told() {
    let mut laws = sweep(&VOCABULARIES);
    let said = |laws: &Laws| {
        let warnings = predict(laws, 1e19, &PredictOptions::default()).unwrap().warnings;
        warnings.iter().any(|warning| warning.contains("outside its own interval"))
    };
    assert!(!said(&laws));
    laws.judgement.recommended = None;
    laws.judgement.joint = None;
    laws.bootstrap.iter_mut().for_each(|sample| {
        sample.loss_intercept += 100.0;
        sample.floor = None;
    });
    assert!(said(&laws));
}

#[test]
fn the_only_vocabulary_is_itself_without_interval_and_built_as_it_is() {
    let laws = Laws { from_sweep: true, ..sweep(&[32000.0]) };
    let prediction = predict(&laws, 1e19, &PredictOptions::default()).unwrap();
    assert_eq!((prediction.at.n_vocab, prediction.ci95.at.n_vocab), (Some(32000.0), None));
    assert!(prediction.together.as_ref().is_none_or(|all| all.at.n_vocab == Some(32000.0)));
    let shape = prediction.shape.as_ref().unwrap();
    assert_eq!((shape.n_vocab, shape.levels.len()), (32000, 0));
}

#[test]
fn a_vocabulary_of_the_trainers_own_has_no_levels() {
    let laws = Laws { from_sweep: true, own_vocabularies: true, ..sweep(&VOCABULARIES) };
    let prediction = predict(&laws, 1e19, &PredictOptions::default()).unwrap();
    let shape = prediction.shape.as_ref().unwrap();
    assert_eq!(shape.n_vocab, prediction.at.n_vocab.unwrap().round() as u64);
    assert!(shape.levels.is_empty() && prediction.ci95.at.n_vocab.is_some());
}

#[test]
fn laws_of_n_alone_predict_n_and_invent_no_vocabulary() {
    let total = |p: IsoFlopPoint| IsoFlopPoint {
        params_nonvocab: p.params_nonvocab + p.params_vocab,
        params_vocab: 0.0,
        n_vocab: 0.0,
        ..p
    };
    let points: Vec<_> = points(&[16384.0]).into_iter().map(total).collect();
    let options = FitOptions { parameters: Parameters::Total, ..options() };
    let laws = fit(&points, &options).unwrap();
    let prediction = predict(&laws, 1e17, &PredictOptions::default()).unwrap();
    let n = prediction.at.params.unwrap();
    assert!(near(6.0 * n * prediction.at.tokens.unwrap(), 1e17, 1e-9));
    let [low, high] = prediction.ci95.at.params.unwrap();
    assert!(low < n && n < high && prediction.ci95.loss_normalised.is_some());
    let json = serde_json::to_value(&prediction).unwrap();
    for key in ["params_nonvocab", "params_vocab", "n_vocab", "shape"] {
        assert!(json.get(key).is_none(), "{key}");
    }
    assert_eq!(serde_json::from_str::<Prediction>(&json.to_string()).unwrap(), prediction);
    assert!(!prediction.warnings.iter().any(|s| s.contains("model size alone")));
}

#[test]
fn another_flop_count_is_spent_and_its_name_compared() {
    let flop_count =
        FlopCount { rule: "openai", flops: &|n, v, d| 6.0 * (n + v + 30.0 * n.powf(0.667)) * d };
    let options = PredictOptions { flop_count, ..PredictOptions::default() };
    let prediction = predict(&scamo(), 1e18, &options).unwrap();
    let spent = prediction
        .at
        .params_nonvocab
        .zip(prediction.at.params_vocab)
        .map(|(n, v)| (flop_count.flops)(n, v, prediction.at.tokens.unwrap()))
        .unwrap();
    assert!(near(spent, 1e18, 1e-9));
    assert!(prediction.warnings.iter().any(|s| s.contains("counts by openai")));
}

#[test]
fn a_vocabulary_far_from_every_codebook_is_pointed_out() {
    // Of so wide a model, a small budget's N_v is less than two codes.
    let shapes = [Shape::swiglu(24, 32, 3200, 256)];
    let options = PredictOptions { shapes: &shapes, ..PredictOptions::default() };
    let prediction = predict(&scamo(), 1e11, &options).unwrap();
    assert_eq!(prediction.shape.as_ref().unwrap().n_vocab, 4);
    assert!(prediction.warnings.iter().any(|s| s.contains("has 4 codes")));
}

#[test]
fn impossible_requests_are_errors() {
    let scamo = scamo();
    for budget in [0.0, -1e18, f64::NAN, f64::INFINITY] {
        let error = predict(&scamo, budget, &PredictOptions::default()).unwrap_err();
        assert!(matches!(error, PredictError::BadBudget(_)));
    }
    let none = PredictOptions { shapes: &[], ..PredictOptions::default() };
    assert_eq!(predict(&scamo, 1e18, &none), Err(PredictError::NothingToChoose("shapes")));
    let mut lawless = scamo.clone();
    lawless.power_laws.tokens = None;
    assert_eq!(
        predict(&lawless, 1e18, &PredictOptions::default()),
        Err(PredictError::MissingLaw { laws: "scamo".into(), quantity: "D" })
    );
    lawless.power_laws.params_vocab = None;
    assert_eq!(
        predict(&lawless, 1e18, &PredictOptions::default()),
        Err(PredictError::MissingLaw { laws: "scamo".into(), quantity: "N_v" })
    );
    assert_eq!(
        predict(&scamo, 1e300, &PredictOptions::default()),
        Err(PredictError::OutOfRange { laws: "scamo".into(), budget: 1e300 })
    );
}

#[test]
fn beyond_the_fit_it_is_told_what_the_laws_say_together() {
    let laws = sweep(&VOCABULARIES);
    assert_eq!(predict(&laws, 1e17, &PredictOptions::default()).unwrap().together, None);
    let far = predict(&laws, 1e19, &PredictOptions::default()).unwrap();
    let together = far.together.as_ref().unwrap();
    let weights: Vec<f64> = together.laws.iter().map(|one| one.weight).collect();
    assert!(weights.len() > 1 && weights.is_sorted_by(|a, b| a >= b), "{weights:?}");
    assert!((weights.iter().sum::<f64>() - 1.0).abs() < 0.02, "{weights:?}");
    let said = |law: Candidate| match law {
        Candidate::Log => far.raw.loss_log,
        Candidate::Floor => far.raw.loss_floor,
        Candidate::Joint | Candidate::JointRepeats => far.raw.loss_joint,
    };
    let mean: f64 = together.laws.iter().map(|one| one.weight * said(one.law).unwrap()).sum();
    assert!((mean / together.loss_normalised - 1.0).abs() < 0.02, "{mean} {far:?}");
    let params = together.at.params_nonvocab.unwrap() + together.at.params_vocab.unwrap();
    assert!(near(6.0 * params * together.at.tokens.unwrap(), 1e19, 1e-6), "{together:?}");
    // The recommended law gives the prediction all the same.
    assert_eq!(far.loss_normalised, said(far.recommended.unwrap()));
}

// Models that are not the best ones for their FLOPs.

const MODEL: ModelSize = ModelSize { params: 1e9, n_vocab: None, params_vocab: None, tokens: 1e12 };

/// L = 1.8 + 480/N^0.35 + 2100/D^0.37 without noise.
fn loss_at(n: f64, d: f64) -> f64 {
    1.8 + 480.0 * n.powf(-0.35) + 2100.0 * d.powf(-0.37)
}

fn by_approach3(bootstrap: usize) -> Laws {
    let budgets = &[1e18, 1e19, 1e20];
    let mut points =
        Simulated { budgets, vocabularies: &[4096.0], noise: 0.0, seed: 3, ..SWEEP }.points();
    for point in &mut points {
        point.params_vocab = 0.0;
        point.loss = loss_at(point.params_nonvocab, point.tokens);
    }
    let options = ParametricOptions { bootstrap, ..ParametricOptions::of(Form::Approach3) };
    let parametric = fit_parametric(&points, &options).unwrap();
    parametric_laws(&points, parametric, "theirs", "6nd")
}

#[test]
fn a_parametric_law_knows_the_loss_of_any_model_and_of_the_best() {
    let laws = by_approach3(100);
    let said = predict_sized(&laws, &MODEL).unwrap();
    assert!((said.loss_normalised - loss_at(1e9, 1e12)).abs() < 1e-6, "{said:?}");
    assert!((said.flops / 6e21 - 1.0).abs() < 1e-12);
    let best = said.optimum;
    let n = best.at.params.unwrap();
    assert!((6.0 * n * best.at.tokens.unwrap() / said.flops - 1.0).abs() < 1e-9);
    assert!((best.loss_normalised - loss_at(n, best.at.tokens.unwrap())).abs() < 1e-6);
    assert!(said.loss_above_optimum > 0.0 && best.at.tokens.unwrap() < MODEL.tokens);
    let [low, high] = said.ci95.loss_normalised.unwrap();
    assert!(low <= said.loss_normalised + 1e-6 && said.loss_normalised - 1e-6 <= high);
    let equal = said.flops_of_equal_loss.unwrap();
    let again = predict_sized(&laws, &at(&laws, equal)).unwrap();
    assert!((again.loss_normalised - said.loss_normalised).abs() < 1e-6);
}

/// The best model for a budget.
fn at(laws: &Laws, flops: f64) -> ModelSize {
    let best = Told::of(laws).unwrap().optimum(flops).unwrap();
    ModelSize { params: best.params_nonvocab, tokens: best.tokens, ..MODEL }
}

#[test]
fn the_best_model_loses_nothing() {
    let laws = by_approach3(0);
    let said = predict_sized(&laws, &at(&laws, 1e22)).unwrap();
    assert!(said.loss_above_optimum.abs() < 1e-9, "{said:?}");
    assert!((said.flops_of_equal_loss.unwrap() / 1e22 - 1.0).abs() < 1e-3);
    assert!(said.ci95.loss_normalised.is_none());
    assert!(said.warnings.iter().any(|warning| warning.contains("no bootstrap")));
}

#[test]
fn a_joint_law_knows_the_loss_beside_the_minimum_and_asks_for_a_vocabulary() {
    let laws = sweep(&[4096.0, 16384.0, 65536.0]);
    let joint = laws.judgement.joint.as_ref().expect("five budgets tell it");
    let best = joint.optimum(1e17).unwrap();
    let model = ModelSize {
        params: best.params_nonvocab / 4.0,
        n_vocab: best.n_vocab,
        params_vocab: None,
        tokens: 4.0 * best.tokens,
    };
    let said = predict_sized(&laws, &model).unwrap();
    assert!(said.loss_above_optimum > 0.0, "{said:?}");
    // A joint law has replicates if it is the recommended one.
    assert_eq!(said.ci95.loss_normalised.is_some(), !joint.bootstrap.is_empty());
    let without = ModelSize { n_vocab: None, ..model };
    let error = predict_sized(&laws, &without).unwrap_err().to_string();
    assert!(error.contains("--vocab V"), "{error}");
}

#[test]
fn laws_of_optima_alone_say_what_to_fit() {
    let error = predict_sized(&scamo(), &MODEL).unwrap_err().to_string();
    assert!(error.contains("--law approach3"), "{error}");
}

#[test]
fn another_vocabulary_than_the_only_one_is_warned_of() {
    let laws = fit(&points(&[4096.0]), &FitOptions { bootstrap: 0, ..options() }).unwrap();
    let warned = |n_vocab| {
        let said = predict_sized(&laws, &ModelSize { n_vocab, params: 1e7, tokens: 1e9, ..MODEL });
        said.unwrap().warnings.iter().any(|warning| warning.contains("knows nothing of V = 50000"))
    };
    assert!(warned(Some(50_000.0)) && !warned(Some(4096.0)) && !warned(None));
    let total = by_approach3(0);
    let error = predict_sized(&total, &ModelSize { n_vocab: Some(50_000.0), ..MODEL }).unwrap_err();
    assert!(error.to_string().contains("knows no vocabulary"), "{error}");
}
