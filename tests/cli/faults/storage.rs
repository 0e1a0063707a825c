//! File systems that are full or may not be written to.

use std::os::unix::process::CommandExt;

use nix::sys::resource::{Resource, setrlimit};

use super::super::support::mounts::Mounted;
use super::super::support::{Ended, Place as Directory};
use super::*;

/// A full disk is no failure of a run, and leaves nothing half-written.
fn assert_in_good_order(results: &Path) {
    assert_eq!(files_with(results, "failure.json"), Vec::<PathBuf>::new());
    assert_eq!(files_with(results, ".partial-"), Vec::<PathBuf>::new());
    let whole = |bytes: &Vec<u8>| serde_json::from_slice::<Value>(bytes).is_ok();
    assert!(records::bytes(results).values().all(whole));
}

/// Starts a sweep that may write no file larger than this.
fn with_file_limit(place: &Directory, args: &[&str], bytes: u64) -> Ended {
    let mut command = place.program(args);
    // SAFETY: between fork and exec only the limit is set, which is async-signal-safe.
    unsafe {
        command.pre_exec(move || Ok(setrlimit(Resource::RLIMIT_FSIZE, bytes, bytes)?));
    }
    Ended::of(args, command.output().expect("the binary can be started"))
}

#[test]
fn a_disk_that_fills_up_stops_the_sweep_in_good_order_and_it_goes_on_when_there_is_room() {
    let place = Place::with("mini.yaml");
    let results = place.path("results");
    let Some(_mounted) = Mounted::small(&results, 4096) else {
        println!("in its place: a_limit_on_file_sizes_is_met_like_a_full_disk");
        return;
    };
    let ballast = results.join("ballast");
    let mut stops = 0;
    // Full at first, then with a little more room each time, so that it is full at another place.
    for room_kib in [8, 60, 200, 400, 700, 1100] {
        std::fs::write(&ballast, vec![0; (4096 - room_kib) * 1024]).expect("room for ballast");
        let ended = place.isoflop(&["run", "mini.yaml", "--jobs", "2"]);
        if ended.code() == Some(0) {
            break;
        }
        stops += 1;
        let ended = ended.exits(1).says("No space left on device").says("free some space");
        let said = ended.stderr();
        let named = said.contains("cannot write results/mini") || said.contains("draw the figure");
        assert!(named, "what could not be written is not named:\n{said}");
        ended.does_not_say("have no result").does_not_say("FAILED (killed)");
        std::fs::remove_file(&ballast).expect("the ballast");
        assert_in_good_order(&results.join("mini"));
    }
    assert!(stops >= 3, "the disk was full {stops} times");
    let _ = std::fs::remove_file(&ballast);
    place.isoflop(&["run", "mini.yaml"]).exits(0);
    assert_undisturbed(&results.join("mini"));
}

#[test]
fn a_limit_on_file_sizes_is_met_like_a_full_disk() {
    let place = Place::with("mini.yaml");
    let results = place.path("results/mini");
    for limit in [20_000, 40_000, 70_000] {
        let ended = with_file_limit(&place, &["run", "mini.yaml"], limit).exits(1);
        ended.says("File too large").says("cannot write").says("or limit");
        assert_in_good_order(&results);
    }
    place.isoflop(&["run", "mini.yaml"]).exits(0);
    assert_undisturbed(&results);
}

#[test]
fn a_folder_that_may_not_be_written_to_is_named_and_can_still_be_read() {
    let place = finished_mini();
    let folder = run_folders(&place, "mini").remove(0);
    std::fs::remove_file(place.path(&folder).join("record.json")).expect("a record");
    {
        let Some(_mounted) = Mounted::read_only(&place.path("results")) else {
            println!("NOT TESTED: a read-only folder, which takes a mount");
            return;
        };
        let ended = place.isoflop(&["run", "mini.yaml"]).exits(1);
        ended.says("results/mini").says("Read-only file system").says("make the folder writable");
        let state = place.isoflop(&["status", "results/mini", "--json"]).exits(0).json();
        assert_eq!(state["runs"]["done"], 7);
        place.isoflop(&["fit", "results/mini"]).says("");
    }
    {
        // Where only the jobs' folders are, the jobs meet it.
        let _mounted = Mounted::read_only(&place.path("results/mini/runs")).expect("as before");
        let ended = place.isoflop(&["run", "mini.yaml"]).exits(1);
        ended.says("stopped [read-only]").says(&folder).says("Read-only file system");
        assert_in_good_order(&place.path("results/mini"));
    }
    place.isoflop(&["run", "mini.yaml"]).exits(0).says("1 jobs to do");
    assert_undisturbed(&place.path("results/mini"));
}
