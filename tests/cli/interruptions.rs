//! Kills and interrupts at any moment: what was finished stays, and the end is the same.

use std::path::PathBuf;
use std::process::Stdio;
use std::time::Duration;

use nix::sys::signal::Signal;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::support::processes::{end_within, kill_9, signal, wait_for, workers};
use super::support::records;
use super::victim::{PATIENCE, Victim, checkpoints, leftovers, losses, tokenizers};

#[test]
fn twelve_kills_change_no_record_and_no_loss() {
    let victim = Victim::new();
    let kills = victim.is_killed(12, 12);
    println!("{kills} kills");
    assert!(kills >= 3, "the sweep ended after {kills} kills");
    let before = records::bytes(&victim.results);
    victim.finish();
    let after = records::bytes(&victim.results);
    assert!(before.iter().all(|(id, bytes)| after.get(id) == Some(bytes)));
    victim.assert_undisturbed();
    assert_eq!(leftovers(&victim.results), Vec::<PathBuf>::new());
}

#[test]
fn a_folder_that_is_renamed_under_a_sweep_fails_no_run() {
    let victim = Victim::new();
    let mut scheduler = victim.start();
    victim.new_checkpoint(&mut scheduler).expect("a sweep of some seconds");
    let moved = victim.place.path("moved");
    std::fs::rename(&victim.results, &moved).unwrap();
    let status = end_within(PATIENCE, &mut scheduler);
    assert_eq!(status.code(), Some(1));
    let failures = |kind: &str| {
        let jobs = std::fs::read_dir(moved.join(kind)).into_iter().flatten().flatten();
        jobs.filter(|job| job.path().join("failure.json").exists()).count()
    };
    assert_eq!(["tokenizers", "runs"].map(failures), [0, 0]);
    // A worker may have written to the old place meanwhile.
    let _ = std::fs::remove_dir_all(&victim.results);
    std::fs::rename(&moved, &victim.results).unwrap();
    victim.finish();
    victim.assert_undisturbed();
}

/// Tokenizers with language, a fixed number of latents, codes of several scales, two kinds of generators; and the
/// masked one.
#[test]
fn kills_change_nothing_whatever_is_trained() {
    for (name, settings) in
        [("language", &["--set", "tokenizer.latents=6"]), ("mini", &["--set", "generator=masked"])]
    {
        let [victim, undisturbed] = [(); 2].map(|()| Victim::of(name, settings));
        let kills = victim.is_killed(9, 3);
        println!("{name}: {kills} kills");
        assert!(kills >= 3, "the sweep ended after {kills} kills");
        [&victim, &undisturbed].iter().for_each(|sweep| sweep.finish());
        victim.assert_same(&undisturbed.results);
        let metrics = [&victim, &undisturbed].map(|sweep| tokenizers(&sweep.results));
        assert_eq!(metrics[0], metrics[1]);
        assert_eq!(leftovers(&victim.results), Vec::<PathBuf>::new());
    }
}

/// An evaluator and scores, which come after the runs.
#[test]
fn kills_change_no_evaluator_and_no_score() {
    let [victim, undisturbed] = [(); 2].map(|()| Victim::of("scored", &[]));
    let kills = victim.is_killed(9, 4);
    println!("{kills} kills");
    assert!(kills >= 3, "the sweep ended after {kills} kills");
    [&victim, &undisturbed].iter().for_each(|sweep| sweep.finish());
    victim.assert_same(&undisturbed.results);
    let of = |sweep: &Victim| records::timeless_scores(&sweep.results);
    assert_eq!(of(&victim), of(&undisturbed));
    assert_eq!(of(&victim).len(), 5, "an evaluator and four scores");
    assert_eq!(leftovers(&victim.results), Vec::<PathBuf>::new());
}

/// Kills a sweep of minutes again and again; `ISOFLOP_KILLS=20` makes it shorter.
#[test]
#[ignore = "takes a quarter of an hour"]
fn two_hundred_kills_change_no_record_of_the_quickstart() {
    let wanted = std::env::var("ISOFLOP_KILLS").map_or(200, |n| n.parse().expect("a number"));
    let victim = Victim::quickstart();
    let mut rng = ChaCha8Rng::seed_from_u64(200);
    let mut kills = 0;
    while kills < wanted {
        let before = records::bytes(&victim.results);
        let mut scheduler = victim.start();
        // Kills are spread over the sweep, however fast the machine is.
        let ahead = before.len() * wanted > kills * 141;
        let most = if ahead { 300 } else { 8000 };
        std::thread::sleep(Duration::from_millis(u64::from(rng.next_u32() % most)));
        if scheduler.try_wait().expect("a child of this process").is_some() {
            break;
        }
        if kills % 3 != 0 {
            workers(&victim.results).into_iter().take(1).for_each(kill_9);
            std::thread::sleep(Duration::from_millis(u64::from(rng.next_u32() % 300)));
        }
        let _ = scheduler.kill();
        scheduler.wait().expect("a child of this process");
        kills += 1;
        let gone = || workers(&victim.results).is_empty().then_some(());
        assert!(
            wait_for(Duration::from_secs(5), gone).is_some(),
            "workers outlive their scheduler"
        );
        let after = records::bytes(&victim.results);
        let same = |(id, bytes): (&String, &Vec<u8>)| after.get(id) == Some(bytes);
        assert!(before.iter().all(same), "a record changed at kill {kills}");
    }
    assert_eq!(kills, wanted, "the sweep ended before");
    println!("{kills} kills, {} records by then", records::bytes(&victim.results).len());
    let hour = Duration::from_secs(3600);
    assert_eq!(end_within(hour, &mut victim.start()).code(), Some(0));
    let undisturbed = Victim::quickstart();
    assert_eq!(end_within(hour, &mut undisturbed.start()).code(), Some(0));
    let expected = records::timeless(&undisturbed.results);
    let found = records::timeless(&victim.results);
    assert_eq!(losses(&found), losses(&expected));
    assert!(found == expected);
    let table = records::timeless_table;
    assert_eq!(table(&victim.results), table(&undisturbed.results));
    assert_eq!(leftovers(&victim.results), Vec::<PathBuf>::new());
}

#[test]
fn the_scheduler_survives_the_kill_of_a_worker() {
    let victim = Victim::new();
    let mut scheduler = victim.start();
    victim.new_checkpoint(&mut scheduler).expect("the sweep is not done yet");
    let found = wait_for(PATIENCE, || workers(&victim.results).first().copied());
    kill_9(found.expect("a worker is there"));
    assert_eq!(end_within(PATIENCE, &mut scheduler).code(), Some(0));
    victim.assert_undisturbed();
}

#[test]
fn an_interrupt_leaves_checkpoints_and_the_same_command_goes_on() {
    for sent in [Signal::SIGINT, Signal::SIGTERM] {
        let victim = Victim::new();
        let mut scheduler = victim.start();
        victim.new_checkpoint(&mut scheduler).expect("the sweep is not done yet");
        signal(&scheduler, sent);
        let status = end_within(Duration::from_secs(20), &mut scheduler);
        assert_eq!(status.code(), Some(130), "{sent}");
        assert!(workers(&victim.results).is_empty());
        assert!(!checkpoints(&victim.results).is_empty(), "a run was under way");
        assert!(!victim.results.join("runs.csv").exists());
        let plan = victim.place.isoflop(&["plan", "mini.yaml", "--out", "out", "--json"]).exits(0);
        let states: Vec<_> = plan.json()["runs"]
            .as_array()
            .unwrap()
            .iter()
            .map(|run| run["state"].clone())
            .collect();
        assert!(states.contains(&"started".into()), "{states:?}");
        victim.finish();
        victim.assert_undisturbed();
    }
}

#[test]
fn a_build_that_replaces_the_program_does_not_stop_its_sweep() {
    let victim = Victim::new();
    let copy = victim.place.path("isoflop");
    std::fs::copy(env!("CARGO_BIN_EXE_isoflop"), &copy).expect("the program can be copied");
    let mut command = std::process::Command::new(&copy);
    command.args(["run", &victim.file(), "--jobs", "2", "--out", "out"]);
    command.current_dir(victim.place.path(".")).stdin(Stdio::null());
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    wait_for(PATIENCE, || victim.results.join("plan.json").exists().then_some(())).unwrap();
    std::fs::remove_file(&copy).unwrap();
    victim.place.write("isoflop", "#!/bin/sh\nexit 9\n");
    assert_eq!(end_within(PATIENCE, &mut child).code(), Some(0));
    victim.assert_undisturbed();
}

#[test]
fn two_commands_on_one_sweep_share_the_work() {
    let victim = Victim::new();
    let [mut first, mut second] = [victim.start(), victim.start()];
    assert_eq!(end_within(PATIENCE, &mut first).code(), Some(0));
    assert_eq!(end_within(PATIENCE, &mut second).code(), Some(0));
    victim.assert_undisturbed();
}

#[test]
fn a_folder_is_held_until_its_figures_are_drawn() {
    let victim = Victim::new();
    let mut first = victim.start();
    wait_for(PATIENCE, || victim.results.join("runs.csv").exists().then_some(())).unwrap();
    let is_held = victim.results.join(".scheduler.json").exists();
    let is_drawn = victim.results.join("figures/tokenizers.png").exists();
    assert!(is_held || is_drawn, "laws and figures are still to come");
    assert_eq!(end_within(PATIENCE, &mut first).code(), Some(0));
    assert!(!victim.results.join(".scheduler.json").exists());
}
