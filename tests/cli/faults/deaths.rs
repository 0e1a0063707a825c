//! Processes that are killed.

use super::*;

/// Ends its worker, whose child it is.
fn kills_its_worker(signal: &str) -> String {
    format!("echo half way >&2\nkill -{signal} $PPID\nsleep 100")
}

#[test]
fn a_worker_that_is_killed_each_time_fails_with_its_log_and_the_command_to_rerun_it() {
    let place = Place::trained_by(&kills_its_worker("KILL"));
    let ended = place.isoflop(&["run", "own.yaml"]).exits(1);
    let ended = ended.says("[killed]").says("starting it again").says("half way");
    assert_eq!(ended.stderr().matches("starting it again").count(), 2);
    let failure = only_failure(&place, "results/own");
    assert_eq!(failure["failure"], "killed");
    assert!(failure["reason"].as_str().expect("a sentence").contains("3 times"), "{failure}");
    assert!(failure["last_lines"].to_string().contains("half way"), "{failure}");
    let log = std::fs::read_to_string(failure["log"].as_str().expect("a path"));
    let log =
        log.or_else(|_| std::fs::read_to_string(place.path(failure["log"].as_str().unwrap())));
    assert_eq!(log.expect("the log is kept").matches("half way").count(), 3);
    let text = place.isoflop(&["status", "results/own"]).exits(0).stdout();
    assert!(text.contains("[killed]") && text.contains("| half way"), "{text}");
    // Not tried again unasked; as advised it is.
    place.isoflop(&["run", "own.yaml"]).exits(1).says("nothing to train").says("[killed]");
    place.write("train.sh", GOOD);
    let again = follow_advice(&place, &failure["retry"]);
    assert_eq!(again.status.code(), Some(0), "{}", String::from_utf8_lossy(&again.stderr));
}

#[test]
fn a_worker_that_is_killed_once_is_started_again_and_the_sweep_is_done() {
    for signal in ["KILL", "TERM", "ABRT"] {
        let once = format!(
            "if [ -e \"$3/begun\" ]; then {GOOD}; exit; fi\ntouch \"$3/begun\"\n{}",
            kills_its_worker(signal)
        );
        let place = Place::trained_by(&once);
        place.isoflop(&["run", "own.yaml"]).exits(0).says("starting it again");
        assert!(!place.path(&run_folders(&place, "own")[0]).join("failure.json").exists());
    }
}

#[test]
fn a_program_that_somebody_kills_is_started_again_and_one_that_fails_is_not() {
    for (script, kind, tries) in [
        ("echo try >> ../tries; kill -9 $$", "killed", 3),
        ("echo try >> ../tries; sh -c 'kill -9 $$'; exit $?", "killed", 3),
        ("echo try >> ../tries; kill -SEGV $$", "trainer", 1),
        ("echo try >> ../tries; exit 3", "trainer", 1),
    ] {
        let place = Place::trained_by(&script.replace("../tries", "tries"));
        place.isoflop(&["run", "own.yaml"]).exits(1).says(&format!("[{kind}]"));
        let found = String::from_utf8(place.read("tries")).expect("text").lines().count();
        assert_eq!(found, tries, "{script}");
        assert_eq!(only_failure(&place, "results/own")["failure"], kind);
    }
}
