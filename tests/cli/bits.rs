//! Sweeps of a commit long ago, trained again to the same bits: `tests/fixtures/losses` has its losses.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::support::{Place, records};

/// What tells runs of a sweep apart, and their losses.
const RUN: [&str; 5] = ["n_layer", "d_model", "n_vocab", "budget_flops", "seed"];
const LOSSES: [&str; 2] = ["loss_nats", "loss_normalised"];

/// On another processor sums are taken in another order; a run then ends within this of the loss.
const NATS_BETWEEN_PROCESSORS: f64 = 0.05;

/// How sweeps of that commit were trained.
const RECIPE: [&str; 4] =
    ["--set", "train.schedule.kind=cosine", "--set", "train.lr={params: total, max: 0.02}"];

/// The losses of a table by run.
type Losses = BTreeMap<Vec<String>, Vec<f64>>;

fn losses(folder: &Path) -> Losses {
    let columns = |names: &[&str]| -> Vec<Vec<String>> {
        names.iter().map(|name| records::column(folder, name)).collect()
    };
    let row = |columns: &[Vec<String>], i: usize| -> Vec<String> {
        columns.iter().map(|column| column[i].clone()).collect()
    };
    let number = |text: &String| text.parse().expect("a loss");
    let (runs, losses) = (columns(&RUN), columns(&LOSSES));
    let rows = 0..runs[0].len();
    rows.map(|i| (row(&runs, i), row(&losses, i).iter().map(number).collect())).collect()
}

/// The losses of a fixture, by way of a folder that holds it as its table.
fn expected(sweep: &str) -> Losses {
    let name = format!("tests/fixtures/losses/{sweep}.csv");
    let place = Place::new();
    let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
    fs::copy(fixture, place.path("runs.csv")).expect("the fixture is there");
    losses(&place.path(""))
}

/// Whether this processor sums in the order of the one that the fixtures are from.
fn sums_alike() -> bool {
    #[cfg(target_arch = "x86_64")]
    return is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512bw");
    #[cfg(not(target_arch = "x86_64"))]
    return false;
}

fn assert_as_before(sweep: &str, results: &Path) {
    let (before, now) = (expected(sweep), losses(results));
    assert_eq!(before.keys().collect::<Vec<_>>(), now.keys().collect::<Vec<_>>());
    if !sums_alike() {
        println!("NOT RUN to the bit: the fixtures are from a processor with AVX-512");
        for (run, losses) in &before {
            let far = losses.iter().zip(&now[run]).map(|(a, b)| (a - b).abs());
            assert!(far.fold(0.0, f64::max) < NATS_BETWEEN_PROCESSORS, "{run:?}");
        }
        return;
    }
    let changed: Vec<_> = before.iter().filter(|(run, losses)| now[*run] != **losses).collect();
    assert!(changed.is_empty(), "{} of {} losses: {changed:?}", changed.len(), before.len());
}

#[test]
fn a_small_sweep_on_real_motion_gives_the_losses_of_before() {
    let data = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/cmu-motion"));
    if !data.exists() {
        println!("NOT RUN: {} is not there", data.display());
        return;
    }
    let place = Place::with("cmu-small.yaml");
    let path = format!("data.path={}", data.display());
    let run = ["run", "cmu-small.yaml", "--set", &path];
    place.isoflop(&[&run[..], &RECIPE].concat()).exits(0);
    assert_as_before("cmu-small", &place.path("results/cmu-small"));
}

#[test]
#[ignore = "trains 141 models, for minutes"]
fn the_quickstart_gives_the_losses_of_before() {
    let place = Place::new();
    let sweep = concat!(env!("CARGO_MANIFEST_DIR"), "/experiments/quickstart.yaml");
    place.isoflop(&[&["run", sweep][..], &RECIPE].concat()).exits(0);
    assert_as_before("quickstart", &place.path("results/quickstart"));
}

#[test]
fn every_set_of_vectors_trains_to_the_same_bits() {
    let trained_on = |vectors: &str| {
        let place = Place::with("mini.yaml");
        let mut program = place.program(&["run", "mini.yaml"]);
        let output = program.env("ISOFLOP_VECTORS", vectors).output().expect("the program starts");
        let lacks = String::from_utf8_lossy(&output.stderr).contains("which this processor lacks");
        assert!(lacks || output.status.success(), "{output:?}");
        (!lacks).then(|| losses(&place.path("results/mini")))
    };
    let [wide, narrow] = ["avx512", "avx2"].map(trained_on);
    if wide.is_none() || narrow.is_none() {
        return println!("NOT RUN: this processor lacks AVX-512 or AVX2");
    }
    assert_eq!(wide, narrow);
}

#[cfg(target_arch = "x86_64")]
#[test]
fn vectors_that_nobody_has_are_refused() {
    let place = Place::with("mini.yaml");
    let output = place.program(&["run", "mini.yaml"]).env("ISOFLOP_VECTORS", "mmx").output();
    let output = output.expect("the program starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        said.contains("ISOFLOP_VECTORS is `mmx`; it may be avx512, avx2 or portable"),
        "{said}"
    );
    assert_eq!(output.status.code(), Some(2), "{said}");
}
