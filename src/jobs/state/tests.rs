//! States of folders that a test made.

use std::fs::{self, File};

use serde_json::json;

use super::*;
use crate::failure::{Failure, FailureKind};
use crate::files::atomic::write_json;
use crate::jobs::speed::Speed;
use crate::jobs::{JobKind, history};
use crate::progress::Beat;

/// A folder whose plan has runs of 1, 2, 3, … FLOPs named `0`, `1`, `2`, …
fn planned(place: &tempfile::TempDir, runs: usize) -> ResultsFolder {
    let folder = ResultsFolder::new(place.path());
    let run = |i: usize| json!({"run_id": i.to_string(), "needs": ["tokens t"], "own_flops": i as f64 + 1.0});
    let runs: Vec<_> = (0..runs).map(run).collect();
    let input = |kind: &str, needs: &[serde_json::Value]| {
        let id = json!({"kind": kind, "id": "t"});
        json!({"id": id, "label": kind, "cost": 1.0, "peak_bytes": 0, "needs": needs})
    };
    let needed = json!({"kind": "tokenizer", "id": "t"});
    let inputs = [input("tokenizer", &[]), input("tokens", &[needed])];
    let plan = json!({"runs": runs, "inputs": inputs});
    write_json(&folder.file("plan.json"), &plan).unwrap();
    folder
}

#[test]
fn a_folder_without_a_plan_is_no_sweeps() {
    let place = tempfile::tempdir().unwrap();
    assert_eq!(sweep_state(&ResultsFolder::new(place.path())).unwrap(), None);
}

#[test]
fn a_live_worker_is_told_from_what_a_dead_one_left() {
    let place = tempfile::tempdir().unwrap();
    let folder = planned(&place, 3);
    for id in ["0", "1"] {
        fs::create_dir_all(folder.run(id).join("checkpoint")).unwrap();
        let beat = Beat { step: 1, steps: 4, loss: 2.0, train_s: 0.5, tokens_per_s: None };
        crate::progress::note_progress(&folder.run(id), &beat);
    }
    fs::write(folder.run("0").join(".lock"), "").unwrap();
    let lock = File::create(folder.run("1").join(".lock")).unwrap();
    lock.try_lock().unwrap();
    let state = sweep_state(&folder).unwrap().unwrap();
    let expected = Counts { started: 1, running: 1, missing: 1, ..Counts::default() };
    assert_eq!(state.runs, expected);
    assert_eq!(state.running.len(), 1);
    assert_eq!(state.running[0].id, JobId::run("1"));
    assert_eq!(state.flops_done, 0.25 * 2.0);
    assert_eq!(state.flops_total, 6.0);
}

#[test]
fn runs_of_a_failed_tokenizer_are_told_from_those_to_come() {
    let place = tempfile::tempdir().unwrap();
    let folder = planned(&place, 2);
    let failure = Failure::new(FailureKind::Diverged, "the loss is NaN");
    write_json(&folder.tokenizer("t").join("failure.json"), &failure).unwrap();
    let state = sweep_state(&folder).unwrap().unwrap();
    assert_eq!(state.runs, Counts { missing: 2, blocked: 2, ..Counts::default() });
    let tokens = state.inputs[&JobKind::Tokens];
    assert_eq!(tokens, Counts { missing: 1, blocked: 1, ..Counts::default() });
    assert_eq!(state.failures[0].reason, failure.reason);
    assert_eq!(state.failures[0].failure_kind, FailureKind::Diverged);
}

#[test]
fn one_estimate_counts_tokenizers_and_checkpoints_right_after_a_resume() {
    let place = tempfile::tempdir().unwrap();
    let folder = planned(&place, 3);
    let all = |_: &JobId| true;
    assert_eq!(time_left(&folder, 1, &all).unwrap(), None, "nothing tells how fast runs are");
    history::note(&folder, &Speed::new(vec![(1.0, 0.5)], 0.25)).unwrap();
    // Runs of 1, 2 and 3 FLOPs at a half a second; a tokenizer and its codes of 1 each at a quarter.
    let estimate = |slots| time_left(&folder, slots, &all).unwrap().unwrap();
    assert_eq!([estimate(1), estimate(2)], [12.0 + 8.0, 10.0]);
    assert_eq!(sweep_state(&folder).unwrap().unwrap().job_seconds_left, Some(20.0));
    let runs_alone = |id: &JobId| id.kind == JobKind::Run;
    assert_eq!(time_left(&folder, 1, &runs_alone).unwrap(), Some(12.0));
    // A run that was stopped half way, and is at work again.
    fs::create_dir_all(folder.run("2").join("checkpoint")).unwrap();
    let beat = Beat { step: 2, steps: 4, loss: 2.0, train_s: 0.0, tokens_per_s: None };
    crate::progress::note_progress(&folder.run("2"), &beat);
    let lock = File::create(folder.run("2").join(".lock")).unwrap();
    lock.try_lock().unwrap();
    let state = sweep_state(&folder).unwrap().unwrap();
    assert_eq!((state.eta_s, estimate(1)), (Some(17.0), 17.0));
}
