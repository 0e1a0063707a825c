//! Clocks that go back or jump.

use std::time::{Duration, SystemTime};

use super::*;

/// Gives every file and folder this time.
fn set_times(folder: &Path, time: SystemTime) {
    for entry in std::fs::read_dir(folder).expect("a readable folder").flatten() {
        if entry.path().is_dir() {
            set_times(&entry.path(), time);
        }
        let file = std::fs::File::open(entry.path()).expect("a readable entry");
        file.set_modified(time).expect("a file of this test's own");
    }
}

#[test]
fn files_of_the_past_and_of_the_future_are_as_good_as_new() {
    let (future, past) = (Duration::from_secs(3_800_000_000), Duration::from_secs(60));
    for time in [future, past].map(|since| SystemTime::UNIX_EPOCH + since) {
        let place = finished_mini();
        set_times(&place.path("results"), time);
        place.isoflop(&["run", "mini.yaml"]).exits(0).says("nothing to train");

        let place = killed_with_checkpoint("runs", &[]);
        set_times(&place.path("results"), time);
        let state = place.isoflop(&["status", "results/mini", "--json"]).exits(0).json();
        assert_eq!(state["at_work"], false);
        assert!(state["runs"]["started"].as_u64() >= Some(1), "{state}");
        place.isoflop(&["run", "mini.yaml"]).exits(0).does_not_say("set aside");
        assert_undisturbed(&place.path("results/mini"));
    }
}

/// What Debian's package `faketime` brings.
const FAKETIME: &str = "/usr/lib/x86_64-linux-gnu/faketime/libfaketimeMT.so.1";

#[test]
fn a_clock_that_jumps_while_runs_are_at_work_changes_nothing() {
    if !Path::new(FAKETIME).exists() {
        return println!("SKIPPED: no libfaketime; the package `faketime` has it");
    }
    let place = Place::with("mini.yaml");
    place.write("clock", "+0");
    let mut command = place.program(&["run", "mini.yaml", "--set", "train.checkpoint_s=0.1"]);
    command.env("LD_PRELOAD", FAKETIME).env("FAKETIME_TIMESTAMP_FILE", place.path("clock"));
    // A system's monotonic clock does not jump.
    command.envs(
        ["FAKETIME_NO_CACHE", "FAKETIME_DONT_FAKE_MONOTONIC", "DONT_FAKE_MONOTONIC"]
            .map(|name| (name, "1")),
    );
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the binary can be started");
    let mut jumps = ["-3650d", "+7300d", "-1d", "+0"].into_iter().cycle();
    let ended = wait_for(PATIENCE, || {
        place.write("clock.new", jumps.next().expect("an endless row"));
        std::fs::rename(place.path("clock.new"), place.path("clock")).expect("ours");
        std::thread::sleep(Duration::from_millis(100));
        child.try_wait().expect("a child of this process")
    });
    let output = child.wait_with_output().expect("it has ended");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(ended.and_then(|status| status.code()), Some(0), "{stderr}");
    assert_undisturbed(&place.path("results/mini"));
}
