//! Workers that live and do nothing.

use super::super::support::processes::stop;
use super::*;

/// Processes with this word on their command line.
fn processes_with(word: &str) -> usize {
    let entries = std::fs::read_dir("/proc").expect("a Linux system").flatten();
    let says = |place: &PathBuf| {
        let line = std::fs::read(place.join("cmdline")).unwrap_or_default();
        line.split(|byte| *byte == 0).any(|one| one == word.as_bytes())
    };
    entries.map(|entry| entry.path()).filter(says).count()
}

#[test]
fn a_stopped_worker_is_killed_and_its_run_goes_on_to_the_same_bits() {
    let place = Place::with("mini.yaml");
    let results = place.path("results/mini");
    // Longer than a busy machine keeps a worker waiting.
    let scheduler = start_mini(&place, &["--set", "train.hang_s=12"]);
    wait_for(PATIENCE, || (!checkpoints(&results, "runs").is_empty()).then_some(()))
        .expect("a run is under way");
    let stopped = wait_for(PATIENCE, || workers(&results).first().copied());
    stop(stopped.expect("a worker is there"));
    let (code, said) = words_of(scheduler);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("no progress for 12 s (train.hang_s)"), "{said}");
    assert!(said.contains("starting it again"), "{said}");
    assert_undisturbed(&results);
    assert_eq!(workers(&results), []);
}

#[test]
fn a_program_that_hangs_each_time_fails_and_none_of_it_is_left() {
    let seconds = format!("8{}.25", std::process::id());
    let place = Place::trained_by(&format!("echo half way; sleep {seconds} & sleep {seconds}"));
    let args = ["run", "own.yaml", "--set", "train.hang_s=1"];
    place.isoflop(&args).exits(1).says("[hung]").says("raise train.hang_s");
    let failure = only_failure(&place, "results/own");
    assert_eq!(failure["failure"], "hung");
    assert!(failure["last_lines"].to_string().contains("half way"), "{failure}");
    let gone = wait_for(PATIENCE, || (processes_with(&seconds) == 0).then_some(()));
    gone.expect("the program is ended with its worker");
    place.write("train.sh", GOOD);
    assert_eq!(follow_advice(&place, &failure["retry"]).status.code(), Some(0));
}

#[test]
fn a_program_that_is_stopped_with_its_guard_is_ended_and_started_again() {
    let seconds = format!("9{}.75", std::process::id());
    let script = format!(
        "if [ -e \"$3/begun\" ]; then {GOOD}; exit; fi\ntouch \"$3/begun\"\nsleep {seconds} &\n\
         kill -STOP 0\nsleep {seconds}"
    );
    let place = Place::trained_by(&script);
    let args = ["run", "own.yaml", "--set", "train.hang_s=1"];
    place.isoflop(&args).exits(0).says("no progress for 1 s");
    let gone = wait_for(PATIENCE, || (processes_with(&seconds) == 0).then_some(()));
    gone.expect("the stopped program is ended");
}

#[test]
fn lines_of_a_program_count_as_progress() {
    let script = format!("for i in $(seq 60); do echo line $i >&2; sleep 0.2; done; {GOOD}");
    let place = Place::trained_by(&script);
    let args = ["run", "own.yaml", "--set", "train.hang_s=8"];
    place.isoflop(&args).exits(0).does_not_say("no progress");
}

#[test]
fn the_limit_changes_no_id_and_an_impossible_one_is_refused() {
    let ids = |setting: &str| {
        let place = Place::with("mini.yaml");
        let plan =
            place.isoflop(&["plan", "mini.yaml", "--json", "--set", setting]).exits(0).json();
        plan["runs"]
            .as_array()
            .expect("runs")
            .iter()
            .map(|run| run["run_id"].clone())
            .collect::<Vec<_>>()
    };
    assert_eq!(ids("train.hang_s=5"), ids("train.hang_s=0"));
    let place = Place::with("mini.yaml");
    place
        .isoflop(&["plan", "mini.yaml", "--set", "train.hang_s=-1"])
        .exits(2)
        .says("-1 is out of range: 0 to 1e9");
}
