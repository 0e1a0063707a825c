//! Kills and interrupts at any moment: what was finished stays, and the end is the same.

use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::Duration;

use isoflop::record::RunRecord;
use nix::sys::signal::Signal;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::support::processes::{end_within, kill_9, signal, wait_for, workers};
use super::support::{Place, finished_mini, records};

/// Far longer than a step of the sweep takes: a test that waits so long has failed.
const PATIENCE: Duration = Duration::from_secs(60);

/// A sweep in a folder whose path is nobody else's, so that its workers can be found.
struct Victim {
    place: Place,
    sweep: &'static str,
    settings: &'static [&'static str],
    results: PathBuf,
}

impl Victim {
    /// `mini.yaml`.
    fn new() -> Self {
        let place = Place::with("mini.yaml");
        let results = place.path("out/mini");
        Self { place, sweep: "mini.yaml", settings: &[], results }
    }

    /// The quickstart, with checkpoints as often as it is killed.
    fn quickstart() -> Self {
        let place = Place::new();
        let sweep = include_str!("../../experiments/quickstart.yaml");
        place.write("quickstart.yaml", format!("{sweep}\n"));
        let results = place.path("out/quickstart");
        let settings = &["--set", "train.checkpoint_s=0.5"];
        Self { place, sweep: "quickstart.yaml", settings, results }
    }

    fn start(&self) -> Child {
        let out = self.place.path("out");
        let args = [&["run", self.sweep, "--jobs", "2"], self.settings, &["--out"]].concat();
        let mut command = self.place.program(&args);
        command.arg(out).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        command.spawn().expect("the binary can be started")
    }

    /// Waits until this scheduler's workers have written a checkpoint that was not there before;
    /// `None` when the sweep ended first.
    fn new_checkpoint(&self, child: &mut Child) -> Option<()> {
        let before = checkpoints(&self.results);
        let seen = wait_for(PATIENCE, || {
            let written = checkpoints(&self.results).iter().any(|c| !before.contains(c));
            let ended = child.try_wait().expect("a child of this process").is_some();
            (written || ended).then_some(!ended)
        });
        seen.expect("the sweep moves").then_some(())
    }

    fn finish(&self) {
        let status = end_within(PATIENCE, &mut self.start());
        assert_eq!(status.code(), Some(0));
    }

    /// The records must be those of a sweep that nobody disturbed.
    fn assert_undisturbed(&self) {
        let undisturbed = finished_mini();
        let expected = records::timeless(&undisturbed.path("results/mini"));
        let found = records::timeless(&self.results);
        assert_eq!(expected.len(), 8);
        assert_eq!(losses(&found), losses(&expected));
        assert_eq!(found, expected);
        let column = |folder: &Path| records::column(folder, "loss_normalised");
        assert_eq!(column(&self.results), column(&undisturbed.path("results/mini")));
    }
}

/// Compared first: a difference here is shorter to read than whole records.
fn losses(records: &std::collections::BTreeMap<String, RunRecord>) -> Vec<(&String, u64)> {
    records.iter().map(|(id, record)| (id, record.loss_normalised().unwrap().to_bits())).collect()
}

/// Each run's checkpoint with the moment it was written.
fn checkpoints(results: &Path) -> Vec<(PathBuf, std::time::SystemTime)> {
    let Ok(runs) = std::fs::read_dir(results.join("runs")) else { return Vec::new() };
    let paths = runs.filter_map(|run| Some(run.ok()?.path().join("checkpoint/state.safetensors")));
    paths.filter_map(|path| Some((path.clone(), path.metadata().ok()?.modified().ok()?))).collect()
}

fn leftovers(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a readable folder");
    entries
        .flat_map(|entry| {
            let path = entry.expect("a readable entry").path();
            let partial =
                path.file_name().is_some_and(|n| n.to_string_lossy().starts_with(".partial"));
            match path.is_dir() {
                true => leftovers(&path),
                false => partial.then_some(path).into_iter().collect(),
            }
        })
        .collect()
}

#[test]
fn twelve_kills_change_no_record_and_no_loss() {
    let victim = Victim::new();
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let mut kills = 0;
    for round in 0..12 {
        let before = records::bytes(&victim.results);
        let mut scheduler = victim.start();
        // The first kills strike at any moment, tokenizers included; the others after progress.
        if round > 1 && victim.new_checkpoint(&mut scheduler).is_none() {
            break;
        }
        std::thread::sleep(Duration::from_millis(u64::from(rng.next_u32() % 250)));
        let (hit_worker, hit_scheduler) = [(false, true), (true, false), (true, true)][round % 3];
        if hit_worker {
            workers(&victim.results).into_iter().take(1).for_each(kill_9);
        }
        if !hit_scheduler {
            // The scheduler notices the loss and starts the job again, until it is killed too.
            std::thread::sleep(Duration::from_millis(u64::from(rng.next_u32() % 150)));
        }
        let _ = scheduler.kill();
        scheduler.wait().expect("a child of this process");
        kills += 1;
        let gone = || workers(&victim.results).is_empty().then_some(());
        let gone = wait_for(Duration::from_secs(3), gone);
        assert!(gone.is_some(), "workers outlive their scheduler: {:?}", workers(&victim.results));
        let after = records::bytes(&victim.results);
        let same = |(id, bytes): (&String, &Vec<u8>)| after.get(id) == Some(bytes);
        assert!(before.iter().all(same), "a record changed in round {round}");
    }
    println!("{kills} kills");
    assert!(kills >= 3, "the sweep ended after {kills} kills");
    let before = records::bytes(&victim.results);
    victim.finish();
    let after = records::bytes(&victim.results);
    assert!(before.iter().all(|(id, bytes)| after.get(id) == Some(bytes)));
    victim.assert_undisturbed();
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
    command.args(["run", victim.sweep, "--jobs", "2", "--out", "out"]);
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
