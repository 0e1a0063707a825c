//! `isoflop compare`: studies side by side.

use std::path::Path;

use super::support::Place;

/// A committed study.
fn study(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("results").join(name).display().to_string()
}

#[test]
fn two_studies_are_told_apart_where_their_intervals_allow() {
    let place = Place::new();
    let (a, b) = (study("procedural-law"), study("cmu-motion"));
    let said = place.isoflop(&["compare", &a, &b, "--out", "figures"]).exits(0).stdout();
    for words in ["exponent of N_nv in C", "procedural-law", "cmu-motion", "sweeps differ in"] {
        assert!(said.contains(words), "{words}: {said}");
    }
    assert!(said.contains("L_u is of each study's own codes"), "{said}");
    assert!(said.lines().all(|line| line.chars().count() <= 100), "{said}");
    assert_eq!(place.names("figures"), ["compare.pdf", "compare.png", "compare.svg"]);
    let found = place.isoflop(&["compare", &a, &b, "--json"]).exits(0).json();
    let quantity = &found["quantities"][0];
    let fitted = place.isoflop(&["fit", &a, "--json"]).exits(0).json();
    let own = &fitted["answer"]["exponents"]["params_nonvocab"];
    assert_eq!(quantity["estimates"][0]["value"], own["value"], "{own}");
    let value = |i: usize| quantity["estimates"][i]["value"].as_f64().expect("a number");
    let difference = &quantity["differences"][1];
    assert!(
        (difference["value"].as_f64().expect("a number") - (value(1) - value(0))).abs() < 1e-12
    );
    assert!(quantity["differences"][0].is_null());
}

#[test]
fn a_study_does_not_differ_from_itself_and_a_published_law_has_no_interval() {
    let place = Place::new();
    let a = study("procedural-law");
    let found = place.isoflop(&["compare", &a, &a, "--json"]).exits(0).json();
    assert_eq!(found["sweeps"], serde_json::json!([]));
    for quantity in found["quantities"].as_array().expect("a list") {
        let (estimate, difference) = (&quantity["estimates"][0], &quantity["differences"][1]);
        assert_eq!(difference["value"].as_f64(), Some(0.0));
        // Without intervals nothing is said to differ or not.
        assert_eq!(difference["differs"].as_bool(), estimate["ci95"].as_array().map(|_| false));
    }
    let found =
        place.isoflop(&["compare", &a, "scamo", "--budget", "1e18", "--json"]).exits(0).json();
    assert!(found["quantities"][0]["differences"][1]["ci95"].is_null());
    place.isoflop(&["compare", &a]).exits(2);
    place.isoflop(&["compare", &a, "no/such"]).exits(2).says("no/such");
}
