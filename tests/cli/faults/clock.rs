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
