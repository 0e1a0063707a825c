//! `isoflop tune`: trials of learning rates, resumed and turned into a rule that a sweep takes.

use super::support::Place;

const TUNE: [&str; 6] = ["tune", "mini.yaml", "--cells", "2", "--set", "grid.budgets=[1e9]"];

#[test]
fn a_rule_is_found_once_and_a_sweep_takes_it() {
    let place = Place::with("mini.yaml");
    let found = place.isoflop(&[&TUNE[..], &["--json"]].concat()).exits(0).json();
    let trials = found["trials"].as_array().expect("trials");
    assert!(trials.len() >= 2 * (3 + 2 + 1), "rates, batches, a schedule: {found:#}");
    assert!(found["rule"]["lr"]["coefficient"].as_f64().is_some_and(|c| c > 0.0), "{found:#}");
    let again = place.isoflop(&[&TUNE[..], &["--json"]].concat()).exits(0);
    assert_eq!(again.json(), found, "what ended is not trained again, and says the same");
    // The tokenizers that the trials needed serve the sweep.
    let tokenizers = place.path("results/mini/tokenizers");
    assert!(std::fs::read_dir(tokenizers).expect("tokenizers").count() >= 1);
    let text = |path| String::from_utf8(place.read(path)).expect("text");
    let (yaml, sweep) = (text("results/mini/rates/rates.yaml"), text("mini.yaml"));
    let others = sweep.lines().filter(|line| !line.starts_with("train:"));
    let sweep: String = others.map(|line| format!("{line}\n")).collect();
    std::fs::write(place.path("tuned.yaml"), sweep + &yaml).expect("a file");
    place.isoflop(&["plan", "tuned.yaml", "--set", "train.min_steps=20"]).exits(0);
}

#[test]
fn what_has_no_rates_to_try_is_refused() {
    let place = Place::with("mini.yaml");
    place.isoflop(&["tune", "mini.yaml", "--cells", "1"]).exits(2);
    place.isoflop(&["tune", "mini.yaml", "--engine", "slurm"]).exits(2).says("--engine local");
}
