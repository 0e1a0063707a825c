//! What editors, shells and manuals are told.

use super::support::Place;

#[test]
fn a_shell_completes_every_command_that_is_shown() {
    let place = Place::new();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = place.isoflop(&["completions", shell]).exits(0).stdout();
        assert!(["predict", "validate", "report"].iter().all(|name| script.contains(name)));
    }
    place.isoflop(&["completions", "tcsh"]).exits(2).says("tcsh");
}

#[test]
fn the_manual_has_a_page_for_each_command() {
    let place = Place::new();
    place.isoflop(&["man", "--out", "man"]).exits(0);
    let pages = place.names("man");
    for page in ["isoflop.1", "isoflop-run.1", "isoflop-predict.1"] {
        assert!(pages.iter().any(|name| name == page), "{pages:?}");
    }
}

#[test]
fn the_schema_is_that_of_the_documents() {
    let place = Place::new();
    let schema = place.isoflop(&["schema"]).exits(0).json();
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/sweep.schema.json");
    let written = std::fs::read(file).expect("the schema is kept");
    assert_eq!(schema, serde_json::from_slice::<serde_json::Value>(&written).expect("JSON"));
    assert!(schema["properties"]["grid"].is_object());
}

#[test]
fn the_doctor_says_what_the_machine_can_do() {
    let place = Place::new();
    let said = place.isoflop(&["doctor"]).exits(0).stdout();
    for what in ["cores", "memory", "flex", "ndarray", "cuda", "kernels", "speed", "slurm", "text"]
    {
        assert!(said.lines().any(|line| line.contains(what)), "{what}: {said}");
    }
    assert!(said.lines().all(|line| line.chars().count() <= 80), "{said}");
    let document = place.isoflop(&["doctor", "--json"]).exits(0).json();
    assert_eq!(document["good"], true);
}

#[test]
fn an_error_is_a_document_too_where_documents_are_asked_for() {
    let place = Place::new();
    let ended = place.isoflop(&["predict", "1e18", "--law", "no/such", "--json"]).exits(2);
    let error = ended.says("error: no/such").json()["error"].clone();
    assert_eq!(error["exit"], 2);
    assert!(error["message"].as_str().is_some_and(|said| said.starts_with("no/such")), "{error}");
    place.write("bad.yaml", "name: a\ngrid: {vocap: [64]}\n");
    let error = place.isoflop(&["plan", "bad.yaml", "--json"]).exits(2).json()["error"].clone();
    assert!(error["message"].as_str().is_some_and(|said| said.contains("vocap")), "{error}");
}
