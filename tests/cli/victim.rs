//! [`Victim`]: a sweep that tests kill, and how its results are compared.

use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::Duration;

use isoflop::record::RunRecord;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::support::processes::{end_within, kill_9, wait_for, workers};
use super::support::{Place, finished_mini, records};

/// Far longer than a sweep takes on a machine that does several other things: a test that waits so long has failed.
pub const PATIENCE: Duration = Duration::from_secs(600);

/// A sweep in a folder whose path is nobody else's, so that its workers can be found.
pub struct Victim {
    pub place: Place,
    /// Of the sweep, and of its file without the ending.
    pub name: &'static str,
    pub settings: &'static [&'static str],
    pub results: PathBuf,
}

impl Victim {
    /// `mini.yaml`.
    pub fn new() -> Self {
        Self::of("mini", &[])
    }

    /// A sweep of the folder of small ones.
    pub fn of(name: &'static str, settings: &'static [&'static str]) -> Self {
        let place = Place::with(&format!("{name}.yaml"));
        Self { results: place.path("out").join(name), place, name, settings }
    }

    /// The quickstart, with checkpoints as often as it is killed.
    pub fn quickstart() -> Self {
        let place = Place::new();
        let sweep = include_str!("../../experiments/quickstart.yaml");
        place.write("quickstart.yaml", format!("{sweep}\n"));
        let results = place.path("out/quickstart");
        let settings = &["--set", "train.checkpoint_s=0.5"];
        Self { place, name: "quickstart", settings, results }
    }

    pub fn start(&self) -> Child {
        let (out, file) = (self.place.path("out"), self.file());
        let args = [&["run", &file, "--jobs", "2"], self.settings, &["--out"]].concat();
        let mut command = self.place.program(&args);
        command.arg(out).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        command.spawn().expect("the binary can be started")
    }

    /// Waits until this scheduler's workers have written a checkpoint that was not there before;
    /// `None` when the sweep ended first.
    pub fn new_checkpoint(&self, child: &mut Child) -> Option<()> {
        let before = checkpoints(&self.results);
        let seen = wait_for(PATIENCE, || {
            let written = checkpoints(&self.results).iter().any(|c| !before.contains(c));
            let ended = child.try_wait().expect("a child of this process").is_some();
            (written || ended).then_some(!ended)
        });
        seen.expect("the sweep moves").then_some(())
    }

    pub fn finish(&self) {
        let status = end_within(PATIENCE, &mut self.start());
        assert_eq!(status.code(), Some(0));
    }

    pub fn file(&self) -> String {
        format!("{}.yaml", self.name)
    }

    /// The records must be those of `mini.yaml` that nobody disturbed.
    pub fn assert_undisturbed(&self) {
        let undisturbed = finished_mini();
        assert_eq!(records::timeless(&self.results).len(), 8);
        self.assert_same(&undisturbed.path("results/mini"));
    }

    /// The records must be those of other results.
    pub fn assert_same(&self, undisturbed: &Path) {
        let expected = records::timeless(undisturbed);
        let found = records::timeless(&self.results);
        assert_eq!(losses(&found), losses(&expected));
        assert_eq!(found, expected);
        let column = |folder: &Path| records::column(folder, "loss_normalised");
        assert_eq!(column(&self.results), column(undisturbed));
    }

    /// Kills workers and schedulers until the sweep ends, at most so often; how often it was.
    ///
    /// No record that was there changes, and nothing outlives its scheduler.
    pub fn is_killed(&self, rounds: usize, seed: u64) -> usize {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut some = |most: u32| {
            std::thread::sleep(Duration::from_millis(u64::from(rng.next_u32() % most)));
        };
        for round in 0..rounds {
            let before = records::bytes(&self.results);
            let mut scheduler = self.start();
            // The first kills strike at any moment, tokenizers included; the others after progress.
            if round > 1 && self.new_checkpoint(&mut scheduler).is_none() {
                return round;
            }
            some(250);
            let (hit_worker, hit_scheduler) =
                [(false, true), (true, false), (true, true)][round % 3];
            if hit_worker {
                workers(&self.results).into_iter().take(1).for_each(kill_9);
            }
            if !hit_scheduler {
                // The scheduler notices the loss and starts the job again, until it is killed too.
                some(150);
            }
            let _ = scheduler.kill();
            scheduler.wait().expect("a child of this process");
            let gone = || workers(&self.results).is_empty().then_some(());
            let gone = wait_for(Duration::from_secs(3), gone);
            assert!(
                gone.is_some(),
                "workers outlive their scheduler: {:?}",
                workers(&self.results)
            );
            let after = records::bytes(&self.results);
            let same = |(id, bytes): (&String, &Vec<u8>)| after.get(id) == Some(bytes);
            assert!(before.iter().all(same), "a record changed in round {round}");
        }
        rounds
    }
}

/// Compared first: a difference here is shorter to read than whole records.
pub fn losses(records: &std::collections::BTreeMap<String, RunRecord>) -> Vec<(&String, u64)> {
    records.iter().map(|(id, record)| (id, record.loss_normalised().unwrap().to_bits())).collect()
}

/// Each run's checkpoint with the moment it was written.
pub fn checkpoints(results: &Path) -> Vec<(PathBuf, std::time::SystemTime)> {
    let Ok(runs) = std::fs::read_dir(results.join("runs")) else { return Vec::new() };
    let paths = runs.filter_map(|run| Some(run.ok()?.path().join("checkpoint/state.safetensors")));
    paths.filter_map(|path| Some((path.clone(), path.metadata().ok()?.modified().ok()?))).collect()
}

pub fn leftovers(folder: &Path) -> Vec<PathBuf> {
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

/// What was measured of each tokenizer, but for how long it took.
pub fn tokenizers(results: &Path) -> Vec<(String, serde_json::Value)> {
    let folders = std::fs::read_dir(results.join("tokenizers")).expect("they were trained");
    let mut found: Vec<_> = folders
        .flatten()
        .map(|folder| {
            let text =
                std::fs::read_to_string(folder.path().join("metrics.json")).expect("measured");
            let mut metrics: serde_json::Value = serde_json::from_str(&text).expect("JSON");
            metrics
                .as_object_mut()
                .expect("an object")
                .retain(|key, _| !key.ends_with("_s") && key != "digest");
            (folder.file_name().to_string_lossy().into_owned(), metrics)
        })
        .collect();
    found.sort_by(|a, b| a.0.cmp(&b.0));
    assert!(!found.is_empty());
    found
}
