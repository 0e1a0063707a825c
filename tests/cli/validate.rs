//! `isoflop validate`: a forecast that is written down before its runs, and what they say of it.

use super::support::{Place, lawful};

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
    place.isoflop(&register).exits(0).says("stands");
    assert_eq!(place.read(path), written);
    place.isoflop(&["validate", "nowhere", "--budget", "1e13"]).exits(2).says("nowhere");
}

#[test]
fn a_forecast_is_tested_by_a_cross_of_cells_and_kept_in_the_laws() {
    let place = Place::with("mini.yaml");
    let cells = [
        "--set",
        "grid.models=[{n_layer: 1, n_head: 1, d_model: 4}, {n_layer: 1, n_head: 1, d_model: 8}, \
         {n_layer: 1, n_head: 1, d_model: 16}]",
        "--set",
        "tokenizer.seeds=[0, 1]",
    ];
    place.isoflop(&[&["run", "mini.yaml"][..], &cells].concat()).exits(0);
    let runs = place.json("results/mini/plan.json")["runs"].as_array().map(Vec::len);
    assert_eq!(runs, Some(24), "three sizes, two vocabularies, two budgets, two tokenizers");
    let words = ["validate", "results/mini", "--budget", "6e9", "--json"];
    let validated = place.isoflop(&words).exits(0).json();
    assert_eq!(validated["budget_flops"], 6e9);
    let runs = validated["measured"]["runs"].as_u64().unwrap_or_default();
    assert!((6..=18).contains(&runs), "{validated:#}");
    assert!(validated["predicted"]["loss"].is_number(), "{validated:#}");
    let kept = &place.json("results/mini/laws.json")["validations"];
    assert_eq!(kept[0], validated);
    // The runs that tested the forecast can be fitted too.
    let fitted = place.isoflop(&["fit", "results/mini", "--validations", "--json"]).exits(0).json();
    assert_eq!(fitted["held_out"]["budget_flops"], 6e9, "{fitted:#}");
    let within = ["validate", "results/mini", "--budget", "1e9", "--register"];
    place.isoflop(&within).exits(0).says("these runs test no forecast");
    // The laws are made anew, and the validation stays.
    place
        .isoflop(&[&["run", "mini.yaml", "--set", "fit.bootstrap=30"][..], &cells].concat())
        .exits(0);
    assert_eq!(place.json("results/mini/laws.json")["validations"][0], validated);
}
