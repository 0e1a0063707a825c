//! `isoflop status` and `isoflop cancel`: what a folder tells, and how a sweep is ended from afar.

use std::fs::{self, File};
use std::path::Path;
use std::process::{Child, Stdio};

use serde_json::{Value, json};

use super::failures::ONE_DIVERGES;
use super::support::processes::{end_within, wait_for, workers};
use super::support::{Place, finished_mini, records};
use super::victim::PATIENCE;

fn status(place: &Place, results: &str) -> Value {
    place.isoflop(&["status", results, "--json"]).exits(0).json()
}

fn counts(done: usize, failed: usize, running: usize, started: usize, missing: usize) -> Value {
    let blocked = 0;
    json!({
        "done": done, "failed": failed, "running": running, "started": started,
        "missing": missing, "blocked": blocked,
    })
}

/// The text for people, which must fit a terminal.
fn text(place: &Place, results: &str) -> String {
    let text = place.isoflop(&["status", results]).exits(0).stdout();
    for line in text.lines().filter(|line| !line.contains(results)) {
        assert!(line.chars().count() <= 80, "{line}");
    }
    text
}

/// Starts `mini.yaml` where its workers can be found.
fn start(place: &Place) -> Child {
    let mut command = place.program(&["run", "mini.yaml", "--jobs", "2", "--out"]);
    command.arg(place.path("out"));
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().expect("the binary can be started")
}

fn run_ids(place: &Place) -> Vec<String> {
    let plan = place.json("results/mini/plan.json");
    let runs = plan["runs"].as_array().expect("a list of runs").iter();
    runs.map(|run| run["run_id"].as_str().expect("an id").to_string()).collect()
}

fn remove_runs(place: &Place, ids: &[String]) {
    for id in ids {
        fs::remove_dir_all(place.path(&format!("results/mini/runs/{id}"))).expect("a run's folder");
    }
}

#[test]
fn a_folder_that_is_no_sweeps_is_named() {
    let place = Place::new();
    for command in ["status", "cancel"] {
        place.isoflop(&[command, "nowhere"]).exits(2).says("nowhere is not a sweep's folder");
        assert!(!place.path("nowhere").exists());
    }
}

#[test]
fn a_finished_sweep_is_done_and_nothing_runs() {
    let place = finished_mini();
    let state = status(&place, "results/mini");
    assert_eq!(state["runs"], counts(8, 0, 0, 0, 0));
    for (kind, n) in [("text", 1), ("tokenizer", 2), ("tokens", 2)] {
        assert_eq!(state["inputs"][kind], counts(n, 0, 0, 0, 0), "{kind}");
    }
    assert_eq!(state["flops_done"], state["flops_total"]);
    assert_eq!((&state["at_work"], &state["scheduler"]), (&json!(false), &Value::Null));
    assert_eq!(state["job_seconds_left"], 0.0);
    let text = text(&place, "results/mini");
    assert!(text.contains("8 of 8 runs done, 100.0 %"), "{text}");
    assert!(!text.contains("to go on"), "{text}");
}

#[test]
fn a_fresh_folder_has_everything_to_do() {
    let place = finished_mini();
    fs::remove_dir_all(place.path("results/mini/runs")).expect("the runs");
    fs::remove_dir_all(place.path("results/mini/tokenizers")).expect("the tokenizers");
    let state = status(&place, "results/mini");
    assert_eq!(state["runs"], counts(0, 0, 0, 0, 8));
    assert_eq!(state["inputs"]["tokenizer"], counts(0, 0, 0, 0, 2));
    assert_eq!(state["inputs"]["text"], counts(1, 0, 0, 0, 0));
    assert_eq!((&state["flops_done"], &state["eta_s"]), (&json!(0.0), &Value::Null));
    let text = text(&place, "results/mini");
    assert!(text.contains("0 of 8 runs done, 0.0 %"), "{text}");
}

#[test]
fn a_half_finished_sweep_tells_the_interrupted_from_the_live_and_the_missing() {
    let place = finished_mini();
    let ids = run_ids(&place);
    remove_runs(&place, &ids[..4]);
    let job = |id: &str| place.path(&format!("results/mini/runs/{id}"));
    for id in &ids[..2] {
        fs::create_dir_all(job(id).join("checkpoint")).expect("a writable directory");
        // What a killed worker left; only a lock says that one is alive.
        let progress = r#"{"step": 5, "steps": 20, "loss": 2.5}"#;
        fs::write(job(id).join(".progress.json"), progress).expect("a writable directory");
        fs::write(job(id).join(".lock"), "").expect("a writable directory");
    }
    let lock = File::open(job(&ids[1]).join(".lock")).expect("the lock");
    lock.try_lock().expect("nobody else has it");
    let state = status(&place, "results/mini");
    assert_eq!(state["runs"], counts(4, 0, 1, 1, 2));
    assert_eq!(state["running"][0]["id"], json!(ids[1]));
    assert_eq!(state["running"][0]["progress"]["step"], 5);
    assert!(state["eta_s"].as_f64().expect("a time") > 0.0);
    assert!(text(&place, "results/mini").contains("step 5 of 20, loss 2.500"));
    drop(lock);
    assert_eq!(status(&place, "results/mini")["runs"], counts(4, 0, 0, 2, 2));
}

#[test]
fn a_failure_is_told_with_its_last_lines_and_the_command_that_tries_it_again() {
    let place = Place::with("mini.yaml");
    let args = [&["run", "mini.yaml", "--jobs", "1"][..], &ONE_DIVERGES].concat();
    place.isoflop(&args).exits(1);
    let state = status(&place, "results/mini");
    assert_eq!(state["runs"], counts(1, 1, 0, 0, 0));
    let failure = &state["failures"][0];
    assert!(failure["reason"].as_str().expect("a sentence").contains("lower train.lr"));
    assert!(failure["last_lines"].is_array());
    let text = text(&place, "results/mini");
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(words.contains("lower train.lr") && words.contains("--retry-failed"), "{text}");
    // As advised from anywhere else, and as broken over lines for people.
    let elsewhere = Place::new();
    let results = place.path("results/mini");
    let results = results.to_str().expect("temporary paths are UTF-8");
    let shown = elsewhere.isoflop(&["status", results]).exits(0).stdout();
    let (_, broken) = shown.split_once("to try again what failed:\n").expect("advice is given");
    for command in [status(&elsewhere, results)["failures"][0]["retry"].as_str().unwrap(), broken] {
        let command =
            command.replace("isoflop run", &format!("{} run", env!("CARGO_BIN_EXE_isoflop")));
        let ended = in_shell(&command, &elsewhere.path(""));
        assert!(ended.contains("1 jobs to do, 1 of 2 runs finished or failed before"), "{ended}");
    }
}

/// What a shell's command says on standard error.
fn in_shell(command: &str, directory: &Path) -> String {
    let mut shell = std::process::Command::new("sh");
    let output = shell.arg("-c").arg(command).current_dir(directory).output();
    String::from_utf8_lossy(&output.expect("a POSIX shell").stderr).into_owned()
}

#[test]
fn a_live_sweep_is_watched_and_cancelled_and_goes_on_to_the_same_bits() {
    let place = Place::with("mini.yaml");
    let results = place.path("out/mini");
    let mut scheduler = start(&place);
    let seen = wait_for(PATIENCE, || {
        let ended = scheduler.try_wait().expect("a child of this process");
        assert!(ended.is_none(), "the sweep ended before it was seen at work");
        if !results.join("plan.json").exists() {
            return None;
        }
        let state = status(&place, "out/mini");
        let jobs = state["running"].as_array().expect("a list").clone();
        jobs.iter()
            .any(|job| job["kind"] == "run" && job["progress"]["step"].is_u64())
            .then_some(state)
    });
    let state = seen.expect("a run is seen at work");
    assert_eq!(state["scheduler"]["pid"], scheduler.id());
    let running = state["runs"]["running"].as_u64().expect("a count");
    assert!((1..=2).contains(&running), "{state}");

    let ended = place.isoflop(&["cancel", "out/mini", "--json"]).exits(0).json();
    assert_eq!((&ended["was_running"], &ended["ended"]), (&json!(true), &json!(true)));
    assert_eq!(ended["state"]["at_work"], false);
    assert_eq!(end_within(PATIENCE, &mut scheduler).code(), Some(130));
    assert!(workers(&results).is_empty());
    assert_eq!(ended["state"]["runs"]["running"], 0);
    assert!(!results.join(".scheduler.json").exists() && !results.join(".cancel").exists());
    let again = place.isoflop(&["cancel", "out/mini"]).exits(0).stdout();
    assert!(again.contains("nothing is running here") && again.contains("to go on:"), "{again}");

    assert_eq!(end_within(PATIENCE, &mut start(&place)).code(), Some(0));
    assert_eq!(status(&place, "out/mini")["runs"], counts(8, 0, 0, 0, 0));
    let undisturbed = records::timeless(&finished_mini().path("results/mini"));
    assert_eq!(records::timeless(&results), undisturbed);
}

#[test]
fn a_run_that_waits_for_the_folder_is_cancelled_with_the_one_at_work() {
    let place = Place::with("mini.yaml");
    let [mut first, mut second] = [start(&place), start(&place)];
    let results = place.path("out/mini");
    let at_work = wait_for(PATIENCE, || (!workers(&results).is_empty()).then_some(()));
    at_work.expect("a worker is started");
    place.isoflop(&["cancel", "out/mini"]).exits(0);
    for scheduler in [&mut first, &mut second] {
        assert_eq!(end_within(PATIENCE, scheduler).code(), Some(130));
    }
    assert!(workers(&results).is_empty());
}
