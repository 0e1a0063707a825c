//! `isoflop validate`: a forecast that is written down before its runs, and what they say of it.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use super::support::{Place, lawful, worked_trainer};

#[test]
fn a_forecast_is_registered_and_stands() {
    let place = lawful();
    place.isoflop(&["run", "lawful.yaml"]).exits(0);
    let validate = ["validate", "results/lawful", "--budget", "1e13"];
    let register = [&validate[..], &["--register", "--json"]].concat();
    let forecast = place.isoflop(&register).exits(0).json();
    assert_eq!(forecast["budget_flops"], 1e13);
    assert!(forecast["loss_normalised"].is_number(), "no loss is forecast");
    let path = "results/lawful/validations/1e13/forecast.json";
    let written = place.read(path);
    place.isoflop(&register).exits(0).says("is used");
    assert_eq!(place.read(path), written);
    place.isoflop(&["validate", "nowhere", "--budget", "1e13"]).exits(2).says("nowhere");
}

#[test]
fn a_forecast_is_tested_by_a_cross_of_cells_and_kept_in_the_laws() {
    let Some(place) = worked_trainer() else { return };
    let sweep = "experiments/custom-trainer.yaml";
    let results = "results/custom-trainer";
    place.isoflop(&["run", sweep, "--jobs", "4"]).exits(0);
    let words = ["validate", results, "--budget", "1e12"];
    let told = place.isoflop(&words).exits(0).stdout();
    for part in ["cross-entropy of the best cell: ", "measured by parabolas through the cells"] {
        assert!(told.contains(part), "{told}");
    }
    let file = format!("{results}/validations/1e12/validation.json");
    let validated = place.json(&file);
    assert_eq!(validated["budget_flops"], 1e12);
    let number = |name: &str| validated.pointer(name).and_then(Value::as_f64).unwrap_or(f64::NAN);
    assert!((7.0..=9.0).contains(&number("/measured/runs")), "{validated:#}");
    // The trainer's law is known, and so is its optimum at this budget.
    let [forecast, found] = ["/predicted/loss", "/measured/loss"].map(number);
    assert!((forecast - found).abs() < 0.03, "{forecast} {found}");
    assert_eq!(validated["inside"]["loss"], true);
    for side in ["/measured/tried/params_nonvocab", "/predicted/params_nonvocab_ci95"] {
        let [low, high] = [0, 1].map(|end| number(&format!("{side}/{end}")));
        assert!(low < number("/measured/params_nonvocab"), "{side}: {low}");
        assert!(high > number("/measured/params_nonvocab"), "{side}: {high}");
    }
    let entropy = number("/measured/loss_nats") - found;
    assert!((entropy - number("/measured/n_vocab").ln()).abs() < 1e-9, "{entropy}");
    let kept = &place.json(&format!("{results}/laws.json"))["validations"];
    assert_eq!(kept[0], validated);
    // The runs that tested the forecast can be fitted too.
    let fitted = place.isoflop(&["fit", results, "--validations", "--json"]).exits(0).json();
    assert!(fitted["fitted_budgets"].to_string().contains("1000000000000"), "{fitted:#}");
    let within = ["validate", results, "--budget", "1e11", "--register"];
    place.isoflop(&within).exits(0).says("these runs test no forecast");
    // The laws are made anew, and the validation stays.
    place.isoflop(&["run", sweep, "--set", "fit.bootstrap=30"]).exits(0);
    assert_eq!(place.json(&format!("{results}/laws.json"))["validations"][0], validated);
}

#[test]
fn what_the_laws_do_not_tell_is_not_validated() {
    let place = Place::with("mini.yaml");
    let sizes = "grid.models=[{n_layer: 1, n_head: 1, d_model: 4}, {n_layer: 1, n_head: 1, d_model: 8}, \
                 {n_layer: 1, n_head: 1, d_model: 16}]";
    let ended = place.isoflop(&["run", "mini.yaml", "--set", sizes]).exits(0);
    ended.says("no laws: not identified: sizes explain how the losses");
    let words = ["validate", "results/mini", "--budget", "6e9"];
    place.isoflop(&words).exits(2).says("results/mini/laws.json does not exist");
    assert!(!place.path("results/mini/validations").exists());
}

#[test]
fn a_budget_without_an_optimum_is_not_validated() {
    let (place, study) =
        (Place::new(), Path::new(env!("CARGO_MANIFEST_DIR")).join("results/procedural-law"));
    for name in ["sweep.yaml", "laws.json"] {
        fs::create_dir_all(place.path("results/study")).unwrap();
        fs::copy(study.join(name), place.path("results/study").join(name))
            .expect("a committed file");
    }
    let words = ["validate", "results/study", "--budget", "1e13", "--register"];
    place.isoflop(&words).exits(0);
    fs::remove_dir_all(place.path("results/study/validations")).unwrap();
    let mut laws = place.json("results/study/laws.json");
    // The sixth coefficient is e1, by which the loss falls with V: now it rises, whatever the budget.
    laws["joint"]["loss"]["values"][5] = json!(-0.8);
    place.write("results/study/laws.json", laws.to_string());
    let told = "has no optimum at 1e13 FLOPs between the vocabulary";
    place.isoflop(&words).exits(3).says(told);
    place.isoflop(&["predict", "1e13", "--law", "results/study"]).exits(3).says(told);
    assert!(!place.path("results/study/validations").exists());
}

#[test]
fn a_trainer_of_one_vocabulary_is_tested_with_it_alone() {
    let Some(place) = worked_trainer() else { return };
    let one = ["--set", "grid.vocab=[1000]"];
    let run = ["run", "experiments/custom-trainer.yaml", "--jobs", "4"];
    place.isoflop(&[&run[..], &one].concat()).exits(0);
    let results = "results/custom-trainer";
    let exponent = |more: &[&str]| {
        let fitted = place.isoflop(&[&["fit", results, "--json"], more].concat()).exits(0).json();
        fitted["answer"]["exponents"]["tokens"]["value"].as_f64().unwrap()
    };
    let before = exponent(&[]);
    let words = ["validate", results, "--budget", "1e12"];
    let told = place.isoflop(&words).exits(0).stdout();
    assert!(told.contains("not varied"), "{told}");
    let validated = place.json(&format!("{results}/validations/1e12/validation.json"));
    assert_eq!(validated["measured"]["vocabularies"], 1);
    assert_eq!(validated["measured"]["n_vocab"], 1000.0);
    assert!(validated["inside"]["params_vocab"].is_null(), "{validated:#}");
    // One run of each cell tells no noise, so no cell ties with another.
    assert!(validated["measured"]["tied"].is_null(), "{validated:#}");
    let after = exponent(&["--validations"]);
    assert!((after - before).abs() < 0.1, "{before} {after}");
}
