//! Folders that an older build left: records of format 1, tables without the newest columns.

use std::fs;
use std::path::Path;

use serde_json::{Map, Value};

use super::support::{Place, finished_mini, records};

/// Facts that format 1 does not have.
const NEW: [&str; 5] = ["generator", "tokenizer_kind", "quantizer", "varied", "share"];

/// A record as builds of format 1 wrote it.
fn of_format_1(record: &[u8]) -> Vec<u8> {
    let record: Value = serde_json::from_slice(record).expect("a whole record");
    let mut facts = Map::new();
    for group in ["planned", "measured", "metrics"] {
        facts.extend(record[group].as_object().expect("an object").clone());
    }
    for name in NEW {
        facts.remove(name).expect("a fact of today");
    }
    let is_newer = |name: &str| {
        ["loss_normalised_block_", "likeliest_"].iter().any(|start| name.starts_with(start))
    };
    facts.retain(|name, _| !is_newer(name));
    assert_eq!(facts.len(), 34);
    serde_json::to_vec_pretty(&facts).expect("plain values")
}

#[test]
fn a_new_record_names_its_generator_and_tokenizer() {
    let results = finished_mini();
    let results = results.path("results/mini");
    let named = ["autoregressive", "convolutional", "fsq"];
    for (column, name) in NEW.into_iter().zip(named) {
        assert_eq!(records::column(&results, column), [name; 8]);
    }
}

#[test]
fn runs_whose_records_an_older_build_wrote_are_not_trained_again() {
    let place = finished_mini();
    let results = place.path("results/mini");
    let losses = records::column(&results, "loss_normalised");
    for (id, record) in records::bytes(&results) {
        fs::write(results.join("runs").join(id).join("record.json"), of_format_1(&record)).unwrap();
    }
    let before = records::bytes(&results);
    let ended = place.isoflop(&["run", "mini.yaml"]).exits(0).says("nothing to train");
    ended.does_not_say("damaged");
    assert_eq!(records::bytes(&results), before);
    assert_eq!(records::column(&results, "loss_normalised"), losses);
    for column in NEW {
        assert_eq!(records::column(&results, column), [""; 8], "{column}");
    }
    place.isoflop(&["plot", "results/mini"]).exits(0);
    let state = place.isoflop(&["status", "results/mini", "--json"]).exits(0).json();
    assert_eq!(state["runs"]["done"], 8);
}

#[test]
fn a_table_of_an_older_build_is_plotted_and_fitted_to_the_same_laws() {
    let committed = Path::new(env!("CARGO_MANIFEST_DIR")).join("results/cmu-motion");
    let place = Place::new();
    for name in ["runs.parquet", "sweep.yaml", "laws.json"] {
        fs::copy(committed.join(name), place.path(name)).expect("a committed file");
    }
    let then = place.json("laws.json");
    place.isoflop(&["plot", "."]).exits(0);
    assert!(place.names("figures").contains(&"power_laws.svg".to_string()));
    let now = place.isoflop(&["fit", ".", "--json"]).exits(0).json();
    assert_eq!(now["metric"], "loss_normalised");
    let near = |pointer: &str| {
        let number = |laws: &Value| laws.pointer(pointer).and_then(Value::as_f64);
        let (then, now) = (number(&then).expect(pointer), number(&now).expect(pointer));
        assert!((now / then - 1.0).abs() < 1e-9, "{pointer}: {now} and not {then}");
    };
    for law in ["params_nonvocab", "params_vocab", "tokens"] {
        near(&format!("/power_laws/{law}/exponent"));
        near(&format!("/power_laws/{law}/log10_coefficient"));
        near(&format!("/power_laws/{law}/exponent_ci95/0"));
    }
    near("/loss/log/slope_per_decade");
}
