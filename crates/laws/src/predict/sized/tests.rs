use super::*;
use crate::laws::simulated::Simulated;
use crate::laws::{
    FitOptions, Form, IsoFlopPoint, ParametricOptions, fit, fit_parametric, parametric_laws, scamo,
};

const MODEL: ModelSize = ModelSize { params: 1e9, n_vocab: None, params_vocab: None, tokens: 1e12 };

/// L = 1.8 + 480/N^0.35 + 2100/D^0.37 without noise.
fn loss(n: f64, d: f64) -> f64 {
    1.8 + 480.0 * n.powf(-0.35) + 2100.0 * d.powf(-0.37)
}

fn by_approach3(bootstrap: usize) -> Laws {
    let sweep = Simulated {
        budgets: &[1e18, 1e19, 1e20],
        n_sizes: 7,
        off_centre: 0.1,
        vocabularies: &[4096.0],
        n_seeds: 1,
        noise: 0.0,
        seed: 3,
    };
    let mut points: Vec<IsoFlopPoint> = sweep.points();
    for point in &mut points {
        point.params_vocab = 0.0;
        point.loss = loss(point.params_nonvocab, point.tokens);
    }
    let options = ParametricOptions { bootstrap, ..ParametricOptions::of(Form::Approach3) };
    let parametric = fit_parametric(&points, &options).unwrap();
    parametric_laws(&points, parametric, "theirs", "6nd")
}

#[test]
fn a_parametric_law_knows_the_loss_of_any_model_and_of_the_best() {
    let laws = by_approach3(100);
    let said = predict_sized(&laws, &MODEL).unwrap();
    assert!((said.loss_normalised - loss(1e9, 1e12)).abs() < 1e-6, "{said:?}");
    assert!((said.flops / 6e21 - 1.0).abs() < 1e-12);
    let best = said.optimum;
    let n = best.at.params.unwrap();
    assert!((6.0 * n * best.at.tokens.unwrap() / said.flops - 1.0).abs() < 1e-9);
    assert!((best.loss_normalised - loss(n, best.at.tokens.unwrap())).abs() < 1e-6);
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
    let sweep = Simulated {
        budgets: &[1e15, 3e15, 1e16, 3e16, 1e17],
        n_sizes: 7,
        off_centre: 0.1,
        vocabularies: &[4096.0, 16384.0, 65536.0],
        n_seeds: 1,
        noise: 0.005,
        seed: 3,
    };
    let options = FitOptions { flops_rule: "6nd".into(), bootstrap: 200, ..FitOptions::default() };
    let laws = fit(&sweep.points(), &options).unwrap();
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
    let sweep = Simulated {
        budgets: &[1e15, 3e15, 1e16, 3e16, 1e17],
        n_sizes: 7,
        off_centre: 0.1,
        vocabularies: &[4096.0],
        n_seeds: 1,
        noise: 0.005,
        seed: 3,
    };
    let options = FitOptions { flops_rule: "6nd".into(), bootstrap: 0, ..FitOptions::default() };
    let laws = fit(&sweep.points(), &options).unwrap();
    let warned = |n_vocab| {
        let said = predict_sized(&laws, &ModelSize { n_vocab, params: 1e7, tokens: 1e9, ..MODEL });
        said.unwrap().warnings.iter().any(|warning| warning.contains("knows nothing of V = 50000"))
    };
    assert!(warned(Some(50_000.0)) && !warned(Some(4096.0)) && !warned(None));
    let total = by_approach3(0);
    let error = predict_sized(&total, &ModelSize { n_vocab: Some(50_000.0), ..MODEL }).unwrap_err();
    assert!(error.to_string().contains("knows no vocabulary"), "{error}");
}
