//! What is tried again when asked for, and what an interrupted sweep has kept.

use super::*;

/// Both cells diverge.
const BOTH_DIVERGE: [&str; 8] = [
    "--set",
    "train.lr={coefficient: 1e6, max: 1e9}",
    "--set",
    "grid.vocab=[16]",
    "--set",
    "grid.budgets=[1e9]",
    "--jobs",
    "1",
];

#[test]
fn one_failure_of_several_is_tried_again_by_its_own_command() {
    let place = Place::with("mini.yaml");
    let ended = place.isoflop(&[&["run", "mini.yaml"], &BOTH_DIVERGE[..]].concat()).exits(1);
    assert_eq!(ended.stderr().matches("failed [diverged]").count(), 2, "{}", ended.stderr());
    assert_eq!(ended.stderr().matches("  again: isoflop run mini.yaml").count(), 2);
    let state = place.isoflop(&["status", "results/mini", "--json"]).exits(0).json();
    for failure in state["failures"].as_array().expect("a list") {
        assert_eq!(failure["failure"], "diverged");
        let again = follow_advice(&place, &failure["retry"]);
        let said = String::from_utf8_lossy(&again.stderr);
        assert!(said.contains("1 jobs to do, 1 of 2 runs finished or failed before"), "{said}");
    }
    let unknown = [&["run", "mini.yaml", "--retry", "nobody"], &BOTH_DIVERGE[..]].concat();
    place.isoflop(&unknown).exits(2).says("--retry nobody: the sweep has no job of this id");
}

#[test]
fn a_run_is_tried_again_together_with_what_it_needs() {
    let place = Place::with("mini.yaml");
    let settings = ["--set", "tokenizer.lr=1e30", "--set", "grid.vocab=[16]"];
    let args = [&["run", "mini.yaml"], &settings[..]].concat();
    place.isoflop(&args).exits(1).says("tokenizer V15 failed [diverged]");
    let run = place.names("results/mini/runs").remove(0);
    let again = [&args[..], &["--retry", &run]].concat();
    place.isoflop(&again).exits(1).says("tokenizer V15 FAILED (diverged)");
}

#[test]
fn an_interrupted_run_counts_for_the_share_that_its_checkpoint_holds() {
    let place = killed_with_checkpoint("runs", &[]);
    let state = place.isoflop(&["status", "results/mini", "--json"]).exits(0).json();
    let plan = place.json("results/mini/plan.json");
    let done = records::timeless(&place.path("results/mini"));
    let runs = plan["runs"].as_array().expect("runs");
    let flops = |run: &&Value| done.contains_key(run["run_id"].as_str().expect("an id"));
    let finished: f64 =
        runs.iter().filter(flops).map(|run| run["own_flops"].as_f64().expect("FLOPs")).sum();
    let counted = state["flops_done"].as_f64().expect("FLOPs");
    assert!(counted > finished, "{counted} with a checkpoint and {finished} without");
    assert!(counted < state["flops_total"].as_f64().expect("FLOPs"));
}
