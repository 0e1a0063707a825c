//! Every failure that a sweep should survive, made for real: one test a row of docs/failures.md.

mod clock;
mod damage;
mod data;
mod deaths;
mod hangs;
mod memory;
mod retries;
mod storage;

use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};

use serde_json::Value;

use super::support::processes::{end_within, kill_9, wait_for, workers};
use super::support::{OWN, Place, finished_mini, records};
use super::victim::PATIENCE;

/// A trainer that does what it should.
const GOOD: &str = r#"echo '{"loss_nats": 1, "loss_normalised": 1}' > "$2""#;

/// The folders of the runs of a sweep in `results`.
fn run_folders(place: &Place, name: &str) -> Vec<String> {
    let runs = place.names(&format!("results/{name}/runs"));
    runs.into_iter().map(|id| format!("results/{name}/runs/{id}")).collect()
}

/// The one failure that `isoflop status` tells of.
fn only_failure(place: &Place, results: &str) -> Value {
    let state = place.isoflop(&["status", results, "--json"]).exits(0).json();
    let failures = state["failures"].as_array().expect("a list").clone();
    assert_eq!(failures.len(), 1, "{failures:?}");
    failures[0].clone()
}

/// Runs the command that is advised, as a shell does.
fn follow_advice(place: &Place, command: &Value) -> std::process::Output {
    let command = command.as_str().expect("a command");
    let command = command.replace("isoflop run", &format!("{} run", env!("CARGO_BIN_EXE_isoflop")));
    let mut shell = std::process::Command::new("sh");
    shell.arg("-c").arg(command).current_dir(place.path(".")).output().expect("a POSIX shell")
}

/// Starts `mini.yaml` where its workers can be found.
fn start_mini(place: &Place, settings: &[&str]) -> Child {
    let args = [&["run", "mini.yaml", "--jobs", "2"], settings, &["--out"]].concat();
    let mut command = place.program(&args);
    command.arg(place.path("results"));
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    command.spawn().expect("the binary can be started")
}

/// What a child says on standard error, until it ends.
fn words_of(mut child: Child) -> (Option<i32>, String) {
    let mut stderr = child.stderr.take().expect("stderr is piped");
    let reader = std::thread::spawn(move || {
        let mut said = String::new();
        let _ = std::io::Read::read_to_string(&mut stderr, &mut said);
        said
    });
    let status = end_within(PATIENCE, &mut child);
    (status.code(), reader.join().expect("a reader"))
}

/// Checkpoints of a kind of job: `runs`, `trunks`, `tokenizers`.
fn checkpoints(results: &Path, kind: &str) -> Vec<PathBuf> {
    let Ok(jobs) = std::fs::read_dir(results.join(kind)) else { return Vec::new() };
    let paths = jobs.filter_map(|job| Some(job.ok()?.path().join("checkpoint/state.safetensors")));
    paths.filter(|path| path.exists()).collect()
}

/// A place whose sweep of `mini.yaml` was killed with -9 when a job of a kind had a checkpoint.
fn killed_with_checkpoint(kind: &str, settings: &[&str]) -> Place {
    let place = Place::with("mini.yaml");
    let results = place.path("results/mini");
    let mut scheduler = start_mini(&place, settings);
    wait_for(PATIENCE, || (!checkpoints(&results, kind).is_empty()).then_some(()))
        .expect("a checkpoint is written");
    workers(&results).into_iter().for_each(kill_9);
    let _ = scheduler.kill();
    scheduler.wait().expect("a child of this process");
    let gone = wait_for(PATIENCE, || workers(&results).is_empty().then_some(()));
    gone.expect("no worker is left");
    assert!(!checkpoints(&results, kind).is_empty(), "the checkpoint outlives the kill");
    place
}

/// The records must be those of a sweep that nobody disturbed.
fn assert_undisturbed(results: &Path) {
    let expected = records::timeless(&finished_mini().path("results/mini"));
    let found = records::timeless(results);
    assert_eq!(found.keys().collect::<Vec<_>>(), expected.keys().collect::<Vec<_>>());
    assert!(found == expected, "records differ: {found:?} and not {expected:?}");
}

/// Files anywhere in a folder whose name has this in it.
fn files_with(folder: &Path, word: &str) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let found = entries.flatten().flat_map(|entry| {
        let path = entry.path();
        match path.is_dir() {
            true => files_with(&path, word),
            false => Some(path)
                .filter(|_| entry.file_name().to_string_lossy().contains(word))
                .into_iter()
                .collect(),
        }
    });
    found.collect()
}
