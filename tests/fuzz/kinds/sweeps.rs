//! Sweep files and profiles.

use std::fs;
use std::path::Path;

use isoflop::data::DataFacts;
use isoflop::jobs::all_jobs;
use isoflop::plan::Plan;
use isoflop::sweep;

use super::{bytes_of, words};
use crate::harness::Kind;
use crate::mutate;

pub const SWEEP: Kind =
    Kind { name: "sweep", file: "a.yaml", seeds: sweeps, mutate: mutate::text, read: planned };
pub const PROFILE: Kind =
    Kind { name: "profile", file: "a.yaml", seeds: profiles, mutate: mutate::text, read: profile };

/// A comment with a `--set` of the command line.
const SETTING: &str = "#set ";

fn sweeps(_: &Path) -> Vec<Vec<u8>> {
    let files = ["mini", "lawful", "generators", "language", "multiscale", "residual", "scored"];
    let mut all: Vec<Vec<u8>> =
        files.iter().map(|name| bytes_of(&format!("tests/sweeps/{name}.yaml"))).collect();
    let set = "name: a\npreset: scamo-nano\n#set train.min_steps=9\n#set grid.vocab=[64, 256]\n\
               trainer: {command: \"python train.py {spec} {out}\"}\n";
    all.extend([set.as_bytes().to_vec(), bytes_of("results/quality/sweep.yaml")]);
    all
}

/// As `isoflop plan` reads and expands it, without its data.
fn planned(path: &Path) -> Result<(), String> {
    let bytes = fs::read(path).expect("just written");
    let text = String::from_utf8_lossy(&bytes);
    let settings: Vec<String> =
        text.lines().filter_map(|line| line.strip_prefix(SETTING)).map(String::from).collect();
    let sweep = sweep::read(path, &settings).map_err(words)?;
    let plan = Plan::new(&sweep, DataFacts::absent("no data here".to_string()));
    let _ = (plan.warnings(), plan.disk_bytes(), all_jobs(&plan).count());
    assert!(plan.total_flops().is_finite(), "{} FLOPs", plan.total_flops());
    let written = serde_yaml::to_string(&sweep).expect("plain values");
    let again = sweep::parse("again.yaml", &written, &[]);
    let again = again.unwrap_or_else(|error| panic!("what is written is not read: {error}"));
    assert_eq!(serde_yaml::to_string(&again).expect("plain values"), written);
    Ok(())
}

fn profiles(_: &Path) -> Vec<Vec<u8>> {
    vec![b"partition: gpu\naccount: a\ntime: 02:00:00\nmem: 4G\n".to_vec()]
}

fn profile(path: &Path) -> Result<(), String> {
    sweep::read_profile(path).map(drop).map_err(words)
}
