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
use isoflop::record::{RunRecord, table};
use isoflop::sweep::{self, Sweep};
use rayon::prelude::*;
use serde_json::{Value, json};

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

const RUNS: usize = 100_000;

/// A run as `plan.json` has it, with as many fields.
fn planned(run_id: &str) -> Value {
    let mut run = serde_json::to_value(record(run_id)).expect("plain values");
    run["state"] = json!("missing");
    run["own_flops"] = json!(1e10);
    run
}

fn record(run_id: &str) -> RunRecord {
    RunRecord {
        run_id: run_id.to_string(),
        seed: 0,
        n_layer: 4,
        n_head: 4,
        d_model: 64,
        d_ff: 256,
        n_ctx: 64,
        n_vocab: 256,
        budget_flops: 1e10,
        flops_openai: 1.0e10,
        flops_6nd: 1.1e10,
        flops_exact: 1.2e10,
        params_nonvocab: 200_000,
        params_vocab: 33_000,
        params_text: 1000,
        params_embedding: 16_512,
        params_head: 16_448,
        tokens: 100_000,
        unique_tokens: 50_000,
        epochs: 2.0,
        steps: 100,
        batch_tokens: 1000,
        lr: 1e-3,
        loss_nats: 3.0,
        loss_normalised: -2.0,
        nats_per_frame: 0.75,
        nats_per_second: 15.0,
        zero_count_targets: 0,
        wall_s: 1.5,
        tokens_per_s: 66_666.0,
        peak_bytes: 100_000_000,
        tokenizer_id: "0123456789abcdef".to_string(),
        device: "flex".to_string(),
        git_revision: "unknown".to_string(),
    }
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
