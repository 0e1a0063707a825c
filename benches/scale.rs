//! What large sweeps ask of one process: `cargo bench --bench scale`.
//!
//! Means of ten on two busy cores, files in the page cache: the status of 100,000 finished runs 0.39 s
//! (0.37 to 0.41), their records into a table 1.0 s (0.94 to 1.08), a plan of a million runs 2.2 s
//! (1.9 to 2.5), with shared trunks 4.3 s (3.5 to 5.0).

use std::fs;
use std::path::Path;

use criterion::{Criterion, criterion_group, criterion_main};
use isoflop::data::DataFacts;
use isoflop::files::atomic;
use isoflop::jobs::ResultsFolder;
use isoflop::jobs::sweep_state;
use isoflop::plan::Plan;
use isoflop::record::{Measured, Metrics, Planned, RunRecord, facts, table};
use isoflop::sweep::{self, Sweep};
use rayon::prelude::*;
use serde_json::{Value, json};

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

const RUNS: usize = 100_000;

/// A run as `plan.json` has it, with as many fields.
fn planned(run_id: &str) -> Value {
    let mut run = serde_json::to_value(record(run_id).planned).expect("plain values");
    let Value::Object(spent) = serde_json::to_value(measured()).expect("plain values") else {
        unreachable!("a struct is an object");
    };
    run.as_object_mut().expect("a struct is an object").extend(spent);
    run["state"] = json!("missing");
    run["own_flops"] = json!(1e10);
    run["needs"] = json!([]);
    run
}

fn record(run_id: &str) -> RunRecord {
    let planned = Planned {
        run_id: run_id.to_string(),
        seed: Some(0),
        n_layer: Some(4),
        n_head: Some(4),
        d_model: Some(64),
        d_ff: Some(256),
        n_ctx: Some(64),
        n_vocab: 256,
        budget_flops: 1e10,
        params_nonvocab: 200_000,
        params_vocab: 33_000,
        params_text: Some(1000),
        params_embedding: Some(16_512),
        params_head: Some(16_448),
        steps: Some(100),
        batch_tokens: Some(1000),
        lr: Some(1e-3),
        tokenizer_id: Some("0123456789abcdef".to_string()),
        generator: Some("autoregressive".to_string()),
        tokenizer_kind: Some("convolutional".to_string()),
        quantizer: Some("fsq".to_string()),
        varied: None,
        share: Some(1.0),
    };
    RunRecord::new(planned, measured(), metrics())
}

fn measured() -> Measured {
    Measured {
        flops_openai: Some(1.0e10),
        flops_6nd: Some(1.1e10),
        flops_exact: Some(1.2e10),
        tokens: 100_000,
        unique_tokens: Some(50_000),
        epochs: Some(2.0),
        zero_count_targets: Some(0),
        wall_s: Some(1.5),
        tokens_per_s: Some(66_666.0),
        peak_bytes: Some(100_000_000),
        device: Some("flex".to_string()),
        git_revision: Some("unknown".to_string()),
    }
}

fn metrics() -> Metrics {
    let metrics = [
        (facts::LOSS_NATS, 3.0),
        (facts::LOSS_NORMALISED, -2.0),
        (facts::NATS_PER_FRAME, 0.75),
        (facts::NATS_PER_SECOND, 15.0),
    ];
    metrics.into_iter().collect()
}

/// A folder whose plan's runs are all finished.
fn finished_sweep(place: &Path) -> (ResultsFolder, Vec<String>) {
    let folder = ResultsFolder::new(place);
    let ids: Vec<String> = (0..RUNS).map(|i| format!("{i:016x}")).collect();
    let runs: Vec<Value> = ids.iter().map(|id| planned(id)).collect();
    let plan = json!({"runs": runs, "inputs": []});
    atomic::write_json(&folder.file("plan.json"), &plan).expect("a writable directory");
    for id in &ids {
        fs::create_dir_all(folder.run(id)).expect("a writable directory");
        let record = serde_json::to_vec(&record(id)).expect("plain values");
        fs::write(folder.run(id).join("record.json"), record).expect("a writable directory");
    }
    (folder, ids)
}

fn folder_of_finished_runs(c: &mut Criterion) {
    let place = tempfile::tempdir().expect("a temporary directory");
    let (folder, ids) = finished_sweep(place.path());
    let look = || sweep_state(&folder).expect("a readable folder").expect("a sweep's folder");
    assert_eq!(look().runs.done, RUNS);
    let into_a_table = || {
        let record = |id: &String| folder.record(id).expect("a readable record");
        let records: Vec<RunRecord> = ids.par_iter().filter_map(record).collect();
        assert_eq!(records.len(), RUNS);
        table::write(folder.root(), &records).expect("a writable directory");
    };
    let mut group = c.benchmark_group("100,000 finished runs");
    group.sample_size(10);
    group.bench_function("status", |b| b.iter(look));
    group.bench_function("into a table", |b| b.iter(into_a_table));
    group.finish();
}

/// 100 models, 20 vocabularies, 20 budgets and 25 seeds, none of which is dropped.
fn million(schedule: &str) -> Sweep {
    let list =
        |n: usize, entry: fn(usize) -> String| (0..n).map(entry).collect::<Vec<_>>().join(", ");
    let text = format!(
        "name: million\nseeds: [{}]\ntrain: {{schedule: {schedule}}}\ngrid:\n  \
         models: {{d_model: [{}], width_per_layer: 64, head_dim: 16}}\n  \
         vocab: [{}]\n  budgets: [{}]\n",
        list(25, |i| i.to_string()),
        list(100, |i| (16 * (i + 1)).to_string()),
        list(20, |i| format!("{{levels: [{}, 8]}}", i + 2)),
        list(20, |i| format!("{:e}", 1e17 * 1.25f64.powi(i as i32))),
    );
    sweep::parse("million.yaml", &text, &[]).expect("a sweep")
}

fn plan_of_a_million_runs(c: &mut Criterion) {
    let mut group = c.benchmark_group("a plan of a million runs");
    group.sample_size(10);
    for (name, schedule) in
        [("alone", "{kind: cosine}"), ("with shared trunks", "{kind: wsd, share: true}")]
    {
        let sweep = million(schedule);
        group.bench_function(name, |b| {
            b.iter(|| {
                let plan = Plan::new(&sweep, DataFacts::absent(String::new()));
                assert_eq!((plan.runs.len(), plan.dropped.len()), (1_000_000, 0));
                plan
            });
        });
    }
    group.finish();
}

criterion_group!(benches, folder_of_finished_runs, plan_of_a_million_runs);
criterion_main!(benches);
