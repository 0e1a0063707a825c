//! Finished sweeps to begin with: one trained once for all tests, one whose losses are made up.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use isoflop::files::atomic;
use isoflop::jobs::ResultsFolder;
use isoflop::record::facts::LOSS_NORMALISED;
use isoflop::record::{Measured, Planned, RunRecord};
use serde_json::Value;

use super::place::Place;

/// A place with `mini.yaml` and a copy of its finished results, trained undisturbed.
pub fn finished_mini() -> Place {
    static TRAINED: OnceLock<PathBuf> = OnceLock::new();
    from_kept("mini", TRAINED.get_or_init(train_mini))
}

fn train_mini() -> PathBuf {
    let place = Place::with("mini.yaml");
    place.isoflop(&["run", "mini.yaml", "--jobs", "3"]).exits(0);
    keep("mini", &place)
}

/// Keeps a place's results for all tests of this process.
fn keep(name: &str, place: &Place) -> PathBuf {
    let kept = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("finished-{name}"));
    let _ = fs::remove_dir_all(&kept);
    copy(&place.path("results"), &kept);
    kept
}

fn from_kept(name: &str, kept: &Path) -> Place {
    let place = Place::with(&format!("{name}.yaml"));
    copy(kept, &place.path("results"));
    place
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("a writable directory");
    for entry in fs::read_dir(from).expect("a readable folder") {
        let entry = entry.expect("a readable entry");
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).expect("a readable file");
        }
    }
}

/// A place with `lawful.yaml` and a record for each of its runs, in `results/lawful`.
///
/// With C in FLOPs, L_u = 3 − 0.5 log10 C + 0.05 ln²(N_nv / N*) + 0.01 ln²(V / 64),
/// N* = 0.1 C^0.5.
pub fn lawful() -> Place {
    static WRITTEN: OnceLock<PathBuf> = OnceLock::new();
    from_kept("lawful", WRITTEN.get_or_init(write_lawful))
}

fn write_lawful() -> PathBuf {
    let place = Place::with("lawful.yaml");
    let plan = place.isoflop(&["plan", "lawful.yaml", "--json"]).exits(0).json();
    let folder = ResultsFolder::new(place.path("results/lawful"));
    for run in plan["runs"].as_array().expect("a list of runs") {
        let record = made_up(run);
        let path = folder.run(&record.planned.run_id).join("record.json");
        atomic::write_json(&path, &record).expect("a writable directory");
    }
    keep("lawful", &place)
}

fn made_up(run: &Value) -> RunRecord {
    let number = |name: &str| run[name].as_f64().unwrap_or_else(|| panic!("{name} in {run}"));
    let count = |name: &str| number(name) as usize;
    let (budget, n_vocab) = (number("budget_flops"), number("n_vocab"));
    let size = (number("params_nonvocab") / (0.1 * budget.sqrt())).ln();
    let loss =
        3.0 - 0.5 * budget.log10() + 0.05 * size.powi(2) + 0.01 * (n_vocab / 64.0).ln().powi(2);
    let planned = Planned {
        run_id: run["run_id"].as_str().expect("an id").to_string(),
        seed: Some(0),
        n_layer: Some(count("n_layer")),
        n_head: Some(count("n_head")),
        d_model: Some(count("d_model")),
        d_ff: Some(count("d_ff")),
        n_ctx: Some(count("n_ctx")),
        n_vocab: count("n_vocab"),
        budget_flops: budget,
        params_nonvocab: count("params_nonvocab"),
        params_vocab: count("params_vocab"),
        ..Planned::default()
    };
    let measured = Measured {
        flops_openai: Some(budget * number("achieved_ratio")),
        flops_6nd: Some(
            6.0 * (number("params_nonvocab") + number("params_vocab")) * number("tokens"),
        ),
        flops_exact: Some(budget),
        tokens: count("tokens"),
        wall_s: Some(1.0),
        ..Measured::default()
    };
    RunRecord::new(planned, measured, [(LOSS_NORMALISED, loss)].into_iter().collect())
}
