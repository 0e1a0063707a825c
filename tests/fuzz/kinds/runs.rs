//! What is kept of runs: results of trainers, records, tables of them.

use std::fs;
use std::path::Path;

use isoflop::files::read_if_there;
use isoflop::jobs::program::TrainerResult;
use isoflop::laws::Metric;
use isoflop::progress::Said;
use isoflop::record::{RunRecord, Tuned, table};
use isoflop::spec::FlopsRule;

use super::{bytes_of, first_lines, words};
use crate::harness::Kind;
use crate::mutate;

pub const RESULT: Kind = Kind {
    name: "result",
    file: "result.json",
    seeds: results,
    mutate: mutate::text,
    read: result,
};
pub const LINES: Kind =
    Kind { name: "lines", file: "stdout", seeds: lines, mutate: mutate::text, read: said };
pub const RECORD: Kind = Kind {
    name: "record",
    file: "record.json",
    seeds: records,
    mutate: mutate::text,
    read: record,
};
pub const RUNS_CSV: Kind = Kind {
    name: "runs-csv",
    file: "runs.csv",
    seeds: |_| {
        vec![
            first_lines("results/cmu-motion/runs.csv", 5),
            first_lines("results/quality/runs.csv", 4),
        ]
    },
    mutate: mutate::text,
    read: runs,
};
pub const RUNS_PARQUET: Kind = Kind {
    name: "runs-parquet",
    file: "runs.parquet",
    seeds: small_parquet,
    mutate: mutate::binary,
    read: runs,
};

fn results(_: &Path) -> Vec<Vec<u8>> {
    let whole = r#"{"loss_nats": 3, "unigram_nats": 4.5, "params_nonvocab": 1000, "params_vocab": 64, "tokens": 1e6,
 "unique_tokens": 5e5, "steps": 100, "batch_tokens": 64, "lr": 1e-3, "flops_exact": 1e12, "nats_per_frame": 0.7,
 "wall_s": 1.5, "tokens_per_s": 1e5, "peak_bytes": 1e9, "device": "gpu", "normalised_by_scale": [-1.0, -2.0],
 "likeliest_exponential_entropy": [1.0, 9.5],
 "clips": [{"nats": 3.5, "unigram_nats": 4.0, "targets": 7}], "log": [], "weights": "weights.safetensors"}"#;
    let small = r#"{"loss_nats": 3, "loss_normalised": -1.5}"#;
    vec![whole.as_bytes().to_vec(), small.as_bytes().to_vec()]
}

fn result(path: &Path) -> Result<(), String> {
    let result = TrainerResult::read(path)?;
    assert!(result.normalised().is_finite(), "L_u {}", result.normalised());
    result.fits(None)
}

fn lines(_: &Path) -> Vec<Vec<u8>> {
    vec![b"{\"step\": 3, \"steps\": 10, \"loss\": 2.5, \"tokens_per_s\": 1e4}\n{\"moved\": 7}\nhello\n".to_vec()]
}

/// Lines that are none of a worker's are its program's own.
fn said(path: &Path) -> Result<(), String> {
    let bytes = fs::read(path).expect("just written");
    for line in bytes.split(|b| *b == b'\n') {
        if let Ok(said) = serde_json::from_slice::<Said>(line) {
            let text = serde_json::to_string(&said).expect("plain values");
            let _ = serde_json::from_str::<Said>(&text).map_err(words)?;
        }
    }
    Ok(())
}

fn records(place: &Path) -> Vec<Vec<u8>> {
    let old = bytes_of("tests/fixtures/record-format-1.json");
    let record: RunRecord = serde_json::from_slice(&old).expect("a record");
    let path = place.join("seed");
    isoflop::files::atomic::write_json(&path, &record).expect("a writable folder");
    vec![old, fs::read(&path).expect("just written")]
}

fn record(path: &Path) -> Result<(), String> {
    let record: RunRecord = read_if_there(path).map_err(words)?.expect("just written");
    used(&[record])
}

fn small_parquet(place: &Path) -> Vec<Vec<u8>> {
    let small = |csv: Vec<u8>| {
        let (from, to) = (place.join("from"), place.join("to"));
        fs::create_dir_all(&from).expect("a writable folder");
        fs::write(from.join("runs.csv"), csv).expect("a writable folder");
        table::write(&to, &table::read(&from).expect("a sound table")).expect("a writable folder");
        fs::read(to.join("runs.parquet")).expect("just written")
    };
    vec![
        small(first_lines("results/cmu-motion/runs.csv", 5)),
        small(first_lines("results/quality/runs.csv", 3)),
    ]
}

fn runs(path: &Path) -> Result<(), String> {
    used(&table::read(path.parent().expect("a folder")).map_err(words)?)
}

/// What becomes of records: points, and a table that holds the same.
fn used(records: &[RunRecord]) -> Result<(), String> {
    let metric = Metric::default();
    for rule in [FlopsRule::OpenAi, FlopsRule::SixNd, FlopsRule::Exact] {
        records.iter().for_each(|record| drop(record.point(rule, &metric)));
    }
    let _ = Tuned::of(records);
    for record in records {
        let text = serde_json::to_string(record).expect("plain values");
        let again: RunRecord = serde_json::from_str(&text).map_err(words)?;
        assert_eq!(again, *record, "a record that is written is read as another");
    }
    Ok(())
}
