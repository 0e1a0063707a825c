//! The trainer in PyTorch is the built-in trainer's twin; where torch is installed.
//!
//! `ISOFLOP_PYTHON` names another Python than `python3`.

use std::process::Command;
use std::time::Duration;

use nix::unistd::Pid;
use serde_json::Value;

use super::support::processes::{kill_9, wait_for};
use super::support::{Ended, Place, records};
use super::torch;

/// Steps whose losses are compared one by one.
const STEPS: usize = 20;
/// How far two losses of a step may lie apart, relatively: what the order of sums in single precision gives.
const OF_A_STEP: f64 = 1e-5;
/// The same at the end of a run.
const AT_THE_END: f64 = 1e-4;

/// A rate and a number of passes at which rounding does not grow until it shows.
const CALM: [&str; 4] = ["train.lr=1e-3", "train.evaluations=2000", "data.clips=256", "seeds=[3]"];

/// A place with a sweep, or `None` if Python has no torch.
fn place_with(sweep: &str) -> Option<Place> {
    torch::python().map(|_| Place::with(sweep))
}

fn program(place: &Place, args: &[&str]) -> Command {
    let mut program = place.program(args);
    torch::with_package(&mut program).env("PYTHONDONTWRITEBYTECODE", "1");
    program
}

fn isoflop(place: &Place, args: &[&str]) -> Ended {
    Ended::of(args, program(place, args).output().expect("the binary can be started"))
}

/// The arguments that run a sweep under a name by a trainer.
fn run<'a>(sweep: &'a str, more: &'a [&'a str]) -> Vec<&'a str> {
    let settings = CALM.iter().chain(more).flat_map(|setting| ["--set", setting]);
    ["run", sweep].into_iter().chain(settings).collect()
}

/// The records of a sweep's runs by what was planned, each with its log.
fn runs(place: &Place, name: &str) -> Vec<(Value, Vec<Value>)> {
    let folder = format!("results/{name}/runs");
    let read = |id: String| {
        let log = place.read(&format!("{folder}/{id}/log.jsonl"));
        let lines = String::from_utf8(log).expect("UTF-8");
        let lines = lines.lines().map(|line| serde_json::from_str(line).expect("JSON"));
        (place.json(&format!("{folder}/{id}/record.json")), lines.collect())
    };
    let mut runs: Vec<(Value, Vec<Value>)> = place.names(&folder).into_iter().map(read).collect();
    let cell = |record: &Value| {
        ["generator", "d_model", "n_vocab", "budget_flops"]
            .map(|key| record["planned"][key].to_string())
    };
    runs.sort_by_key(|(record, _)| cell(record));
    runs
}

/// How far two losses lie apart, relatively; below a tenth of a nat, as if they were so large.
fn apart(a: &Value, b: &Value) -> f64 {
    let [a, b] = [a, b].map(|x| x.as_f64().unwrap_or_else(|| panic!("{x} is no number")));
    (b - a).abs() / a.abs().max(0.1)
}

/// Trains a sweep by both trainers and compares each run.
fn assert_twins(sweep: &str, more: &[&str]) {
    let Some(place) = place_with(sweep) else { return };
    let torch = [more, &["trainer=torch", "name=torch"]].concat();
    isoflop(&place, &run(sweep, &torch)).exits(0);
    isoflop(&place, &run(sweep, &[more, &["name=own"]].concat())).exits(0);
    let (torch, own) = (runs(&place, "torch"), runs(&place, "own"));
    assert!(torch.len() == own.len() && !own.is_empty());
    for ((theirs, their_log), (ours, our_log)) in torch.iter().zip(&own) {
        assert_eq!(theirs["measured"]["flops_exact"], ours["measured"]["flops_exact"]);
        assert_eq!(their_log.len(), our_log.len());
        for (step, (a, b)) in our_log.iter().zip(their_log).take(STEPS).enumerate() {
            let off = apart(&a["train_loss_nats"], &b["train_loss_nats"]);
            assert!(off < OF_A_STEP, "step {}: {a} and {b}", step + 1);
        }
        for (name, loss) in ours["metrics"].as_object().expect("metrics by name") {
            let off = apart(loss, &theirs["metrics"][name]);
            assert!(off < AT_THE_END, "{name}: {loss} and {}", theirs["metrics"][name]);
        }
    }
}

#[test]
fn the_autoregressive_generator_has_a_twin_in_torch() {
    assert_twins("mini.yaml", &["grid.budgets=[3e8]"]);
}

#[test]
fn the_generators_of_several_scales_have_twins_in_torch() {
    assert_twins("generators.yaml", &["grid.budgets=[1e8]", "grid.vocab=[16]"]);
}

#[test]
fn the_masked_generator_has_a_twin_in_torch() {
    assert_twins("mini.yaml", &["generator=masked", "grid.budgets=[1e8]"]);
}

#[test]
fn the_two_stages_of_the_masked_generator_have_twins_in_torch() {
    assert_twins("residual.yaml", &["generator=masked", "grid.budgets=[1e8]", "grid.vocab=[16]"]);
}

#[test]
fn a_share_of_the_data_is_the_same_share_in_torch() {
    assert_twins("mini.yaml", &["grid.budgets=[1e8]", "grid.shares=[0.25]"]);
}

#[test]
fn a_run_that_is_killed_goes_on_to_the_same_loss_in_torch() {
    let Some(place) = place_with("mini.yaml") else { return };
    let one =
        ["grid.models=[{n_layer: 2, n_head: 2, d_model: 16}]", "grid.vocab=[16]", "trainer=torch"];
    let cell = [&one[..], &["grid.budgets=[2e9]", "train.checkpoint_s=0.2", "train.evaluations=2"]]
        .concat();
    let whole = [&cell[..], &["name=whole"]].concat();
    isoflop(&place, &run("mini.yaml", &whole)).exits(0);
    let killed = [&cell[..], &["name=killed"]].concat();
    let args = run("mini.yaml", &killed);
    let mut child = program(&place, &args).spawn().expect("the binary can be started");
    let saved = || {
        let runs = place.path("results/killed/runs");
        let folder = std::fs::read_dir(runs).ok()?.next()?.ok()?.path();
        folder.join("checkpoint/state.pt").exists().then_some(())
    };
    assert!(wait_for(Duration::from_secs(60), saved).is_some(), "no checkpoint was written");
    kill_9(Pid::from_raw(child.id() as i32));
    child.wait().expect("it has ended");
    isoflop(&place, &args).exits(0);
    let losses = |name| records::column(&place.path(&format!("results/{name}")), "loss_nats");
    assert_eq!(losses("whole"), losses("killed"));
    let log = place.names("results/killed/runs").remove(0);
    let log = place.read(&format!("results/killed/runs/{log}/log.txt"));
    assert!(String::from_utf8_lossy(&log).contains("going on from step"));
}

#[test]
fn motions_are_made_of_a_run_that_torch_trained() {
    let Some(place) = place_with("mini.yaml") else { return };
    let one = [
        "grid.models=[{n_layer: 1, n_head: 1, d_model: 8}]",
        "grid.vocab=[16]",
        "grid.budgets=[1e8]",
    ];
    isoflop(&place, &run("mini.yaml", &[&one[..], &["trainer=torch"]].concat())).exits(0);
    isoflop(&place, &["generate", "a person walks", "--run", "results/mini", "--out", "made"])
        .exits(0);
    assert!(!place.names("made").is_empty());
}

#[test]
fn a_device_that_is_not_there_is_told_before_the_first_step() {
    let Some(place) = place_with("mini.yaml") else { return };
    let set = ["trainer=torch --device cuda", "grid.vocab=[16]", "grid.budgets=[1e8]"];
    let args = run("mini.yaml", &set);
    let ended = program(&place, &args).env("CUDA_VISIBLE_DEVICES", "").output();
    let ended = Ended::of(&args, ended.expect("the binary can be started"));
    ended.exits(1).says("torch sees no CUDA device here");
}

#[test]
fn half_precision_that_torch_does_not_train_in_is_refused() {
    let place = Place::with("mini.yaml");
    let args = run("mini.yaml", &["trainer=torch", "train.precision=f16"]);
    isoflop(&place, &args).exits(2).says("the torch trainer computes in f32 or bf16");
}

#[test]
fn a_python_without_the_trainer_is_told_what_to_install() {
    let place = Place::with("mini.yaml");
    place.write("python3", "#!/bin/sh\necho 'No module named isoflop' >&2\nexit 1\n");
    let python = place.path("python3");
    let executable = std::os::unix::fs::PermissionsExt::from_mode(0o755);
    std::fs::set_permissions(&python, executable).expect("a writable directory");
    let args = run("mini.yaml", &["trainer=torch", "grid.vocab=[16]", "grid.budgets=[1e8]"]);
    let ended = program(&place, &args).env("ISOFLOP_PYTHON", &python).output();
    let ended = Ended::of(&args, ended.expect("the binary can be started"));
    ended.exits(1).says("pip install 'isoflop[torch]'");
}
