//! Presets in the place of a sweep file, and below one.

use std::fs;

use serde_json::Value;

use super::support::Place;

/// Settings that leave a preset's shape and make it train in a second.
const SHORT: [&str; 12] = [
    "--set",
    "grid.budgets=[1e10]",
    "--set",
    "tokenizer.steps=3",
    "--set",
    "data={clips: 16, val_clips: 4, test_clips: 8}",
    "--set",
    "train.min_steps=1",
    "--set",
    "tokenizer.batch=2",
    "--set",
    "train.evaluations=1",
];

#[test]
fn a_preset_is_planned_and_run_where_there_is_no_file_of_its_name() {
    let place = Place::new();
    let plan = place.isoflop(&["plan", "t2m-gpt", "--json"]).exits(0).json();
    assert_eq!(plan["runs"].as_array().map(Vec::len), Some(1));
    assert_eq!(plan["runs"][0]["n_ctx"], 32 + 51);
    place.isoflop(&[&["run", "t2m-gpt-nano"], &SHORT[..]].concat()).exits(0);
    let sweep = String::from_utf8(place.read("results/t2m-gpt-nano/sweep.yaml")).expect("UTF-8");
    let keys: serde_yaml::Mapping = serde_yaml::from_str(&sweep).expect("YAML");
    assert!(!keys.contains_key("preset"), "it is whole by itself: {sweep}");
    assert_eq!(keys["tokenizer"]["width"], serde_yaml::Value::from(64));
    let again = place.isoflop(&["run", "results/t2m-gpt-nano/sweep.yaml"]).exits(0);
    assert!(again.stdout().contains("t2m-gpt-nano: 1 finished runs"), "{}", again.stdout());
}

#[test]
fn a_file_of_a_presets_name_is_the_sweep() {
    let place = Place::with("mini.yaml");
    fs::rename(place.path("mini.yaml"), place.path("lg-tok")).expect("it is there");
    let plan = place.isoflop(&["plan", "lg-tok", "--json"]).exits(0).json();
    assert_eq!(plan["runs"].as_array().map(Vec::len), Some(8));
}

#[test]
fn a_file_is_laid_over_its_preset_and_settings_over_both() {
    let place = Place::new();
    let text = "preset: lg-tok-nano
name: mine
tokenizer: {quantizer: {kind: multiscale, scales: [2, 4]}, width: 32}
train: {min_steps: 7}
";
    place.write("mine.yaml", text);
    let planned = |settings: &[&str]| -> Value {
        place.isoflop(&[&["plan", "mine.yaml", "--json"], settings].concat()).exits(0).json()
    };
    let plan = planned(&[]);
    // 32 words and 6 codes a clip; two codebooks of 64 and 192.
    assert_eq!((&plan["runs"][0]["n_ctx"], &plan["runs"][0]["n_vocab"]), (&38.into(), &256.into()));
    assert_eq!(plan["runs"][0]["generator"], "scalewise");
    let plan = planned(&["--set", "tokenizer.quantizer.scales=[3, 5]"]);
    assert_eq!(plan["runs"][0]["n_ctx"], 40);
    let other = ["--set", "tokenizer.kind=patch", "--set", "generator=autoregressive"];
    let plan = planned(&other);
    assert_eq!(plan["tokenizers"][0]["kind"], "multiscale", "the file's own quantizer stays");
    let preset = place.isoflop(&[&["plan", "lg-tok-nano", "--json"], &other[..]].concat());
    assert_eq!(preset.exits(0).json()["tokenizers"][0]["kind"], "vq", "that of patches");
}

#[test]
fn what_is_wrong_is_shown_in_the_file_or_in_the_preset() {
    let place = Place::new();
    place.write("mine.yaml", "preset: lg-tok\ntokenizer: {heads: 3}\ngenerator: masked\n");
    let ended = place.isoflop(&["plan", "mine.yaml"]).exits(2);
    ended.says("mine.yaml:2:20").says("mine.yaml:3:12").says("mine.yaml: 2 problems");
    place.write("mine.yaml", "preset: lg-tok\nname: mine\ntokenizer: {quantizer: {kind: vq}}\n");
    let ended = place.isoflop(&["plan", "mine.yaml"]).exits(2);
    ended.says("preset lg-tok:").says("generator: scalewise").says("the quantizer has one");
    let set = ["plan", "lg-tok-mid", "--set", "tokenizer.heads=3"];
    place.isoflop(&set).exits(2).says("in --set tokenizer.heads=3");
    let set = ["plan", "lg-tok-mid", "--set", "generator=masked"];
    place.isoflop(&set).exits(2).says("in --set generator=masked");
}

#[test]
fn an_unknown_preset_is_told_the_nearest_names() {
    let place = Place::new();
    place.write("mine.yaml", "preset: mosa-nana\nname: mine\n");
    let ended = place.isoflop(&["plan", "mine.yaml"]).exits(2);
    ended
        .says("mine.yaml:1:9")
        .says("no preset is named `mosa-nana`")
        .says("did you mean `mosa-nano`?");
    place.write("mine.yaml", "preset: [mosa]\n");
    place.isoflop(&["plan", "mine.yaml"]).exits(2).says("expected the name of a preset");
    place.isoflop(&["plan", "lg-tokk"]).exits(2).says("cannot read lg-tokk").says("`lg-tok`?");
    place.isoflop(&["run", "nothing"]).exits(2).says("valid here: lg-tok, lg-tok-mid");
    let set = ["plan", "mine.yaml", "--set", "preset=momsk"];
    place.isoflop(&set).exits(2).says("in --set preset=momsk").says("`momask`?");
    let help = place.isoflop(&["plan", "--help"]).exits(0).stdout();
    assert!(help.contains("a preset: lg-tok, lg-tok-mid"), "{help}");
}
