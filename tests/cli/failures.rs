//! Runs that fail: the others finish, the reason is kept, nothing is tried again unasked.

use super::support::{Place, records};

/// At this rule the small model learns and the large one blows up.
pub const ONE_DIVERGES: [&str; 6] = [
    "--set",
    "train.lr={coefficient: 1e-14, params_exponent: 4, max: 1e9}",
    "--set",
    "grid.vocab=[16]",
    "--set",
    "grid.budgets=[1e9]",
];

fn with<'a>(first: &[&'a str], settings: &[&'a str]) -> Vec<&'a str> {
    [first, settings].concat()
}

#[test]
fn a_run_that_diverges_fails_alone_and_is_tried_again_only_when_asked() {
    let place = Place::with("mini.yaml");
    let args = with(&["run", "mini.yaml"], &ONE_DIVERGES);
    let first = place.isoflop(&args).exits(1);
    let first = first.says("lower train.lr").says("[diverged]").says("1 of 2 runs have no result");
    assert_eq!(records::bytes(&place.path("results/mini")).len(), 1);
    assert_eq!(records::column(&place.path("results/mini"), "d_model"), ["8"]);
    let failed: Vec<String> = place
        .names("results/mini/runs")
        .into_iter()
        .filter(|id| place.path(&format!("results/mini/runs/{id}/failure.json")).exists())
        .collect();
    assert_eq!(failed.len(), 1);
    let failure = format!("results/mini/runs/{}/failure.json", failed[0]);
    let reason = place.json(&failure)["reason"].as_str().expect("a sentence").to_string();
    assert!(reason.contains("lower train.lr"), "{reason}");
    assert!(first.stderr().contains(&reason));

    let again = place.isoflop(&args).exits(1).says("nothing to train").says(&reason);
    again.does_not_say("FAILED");
    let retry = with(&args, &["--retry-failed"]);
    place.isoflop(&retry).exits(1).says("1 jobs to do").says("FAILED").says(&reason);
}

#[test]
fn the_command_that_is_advised_is_the_one_that_was_given() {
    let place = Place::with("mini.yaml");
    let args = with(&["run", "mini.yaml", "--out", "my out", "--jobs", "1"], &ONE_DIVERGES);
    let ended = place.isoflop(&args).exits(1);
    let stderr = ended.stderr();
    let advice = stderr.lines().find_map(|line| line.split_once("to try them again: isoflop "));
    let (_, words) = advice.expect("advice is given");
    let shell = format!("{} {words}", env!("CARGO_BIN_EXE_isoflop"));
    let mut command = std::process::Command::new("sh");
    command.arg("-c").arg(shell).current_dir(place.path(""));
    let output = command.output().expect("a POSIX shell");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("1 jobs to do, 1 of 2 runs finished or failed before"), "{stderr}");
}

#[test]
fn the_first_failure_stops_the_rest_where_that_is_asked_for() {
    let place = Place::with("mini.yaml");
    let args = ["run", "mini.yaml", "--fail-fast", "--jobs", "1", "--set", "train.lr.max=1e9"];
    let lr = ["--set", "train.lr.coefficient=1e6"];
    place.isoflop(&with(&args, &lr)).exits(1).says("the failure of another job stopped it");
    let failures = place
        .names("results/mini/runs")
        .into_iter()
        .filter(|id| place.path(&format!("results/mini/runs/{id}/failure.json")).exists());
    assert_eq!(failures.count(), 1);
}

#[test]
fn runs_of_a_tokenizer_that_failed_are_never_started() {
    let place = Place::with("mini.yaml");
    let settings = ["--set", "tokenizer.lr=1e30", "--set", "grid.vocab=[16]"];
    let args = with(&["run", "mini.yaml"], &settings);
    for _ in 0..2 {
        let ended = place.isoflop(&args).exits(1);
        let ended = ended.says("its tokenizer failed").says("lower tokenizer.lr");
        ended.says("4 of 4 runs have no result");
        for run in place.names("results/mini/runs") {
            assert_eq!(place.names(&format!("results/mini/runs/{run}")), ["spec.json"]);
        }
    }
}
