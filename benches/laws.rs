//! The fits of published tables and of a sweep, each on one thread: `just bench-laws`.
//!
//! Tables made elsewhere lie under `../shared`; a case whose table is absent says so and is skipped.
//! `laws_peer.py` times the same fits beside those of public analyses.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use criterion::{Criterion, SamplingMode, criterion_group, criterion_main};
use isoflop::laws::{
    FitOptions, Form, HoldOut, Huber, IsoFlopPoint, Metric, ParametricOptions, Space, Starts,
    approach1, fit, fit_parametric,
};
use isoflop::record::{RunRecord, table as runs};
use isoflop::spec::FlopsRule;
use isoflop::sweep::{self, HoldOutSpec};
use isoflop::table::{self, TableRequest};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rayon::ThreadPoolBuilder;

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Rows of the synthetic table.
const MILLION: usize = 1_000_000;

/// Experiments of the collection.
const EXPERIMENTS: [&str; 3] = [
    "epochai_chinchilla__massivetext__chinchilla",
    "ml_scalefit__massivetext__chinchilla",
    "marin_202603__comma__llama_2",
];

/// Tokens in billions, of H billion characters: Tao et al.'s D = H f(V), and what their script has,
/// f at a thousandth of V.
const TOKENS: [(&str, &str); 2] = [("H f(V)", "vocab_size"), ("H f(V/1000)", "(vocab_size/1000)")];

fn chinchilla(criterion: &mut Criterion) {
    let columns = "params=Model Size,budget_flops=Training FLOP,loss=loss";
    let request = TableRequest { drop_highest: 5, ..request(columns, &[]) };
    let Some(points) = shared("epoch_chinchilla/svg_extracted_data.csv", &request) else { return };
    let options = ParametricOptions {
        huber: Huber::Delta(1e-3),
        bootstrap: 0,
        ..ParametricOptions::of(Form::Approach3)
    };
    let replicates = ParametricOptions { bootstrap: 4000, seed: 42, ..options.clone() };
    let all_starts = ParametricOptions { starts: Starts::Grid, ..options.clone() };
    parametric(criterion, "Chinchilla: default starts", &points, &options);
    parametric(criterion, "Chinchilla: 4500 starts", &points, &all_starts);
    parametric(criterion, "Chinchilla: 4000 replicates", &points, &replicates);
}

fn collection(criterion: &mut Criterion) {
    let columns = "params=params/1e6,tokens=tokens/1e9,loss=loss,budget_flops=budget";
    let options = ParametricOptions {
        space: Space::Raw,
        huber: Huber::Delta(1e-3),
        bootstrap: 0,
        ..ParametricOptions::of(Form::Approach3)
    };
    for experiment in EXPERIMENTS {
        let request = request(columns, &[&format!("experiment == \"{experiment}\"")]);
        let Some(points) = shared("isoflop_collection/isoflops.csv", &request) else { return };
        parametric(criterion, &format!("collection: {experiment}"), &points, &options);
    }
}

fn vocabulary(criterion: &mut Criterion) {
    let options = ParametricOptions {
        huber: Huber::Delta(1e-3),
        tied: true,
        bounds: [0.1, 1.0],
        bootstrap: 0,
        ..ParametricOptions::of(Form::Approach3Vocab)
    };
    for (name, v) in TOKENS {
        let columns = format!(
            "params_nonvocab=Non_vocab_parameters/1e6,params_vocab=vocab_size*embed_dim/1e6,\
             tokens=num_characters/1e9*\
             (0.00639222*ln({v})^2-0.15811069*ln({v})+1.20470122),loss=Lossu"
        );
        let request = request(&columns, &["FLOPs >= 2.18e17"]);
        let Some(points) = shared("scaling_with_vocab/exp_data.csv", &request) else { return };
        parametric(criterion, &format!("vocabulary: D = {name}"), &points, &options);
    }
}

fn sweep_of_motion(criterion: &mut Criterion) {
    let folder = here("results/cmu-motion");
    if !folder.exists() {
        return skipped(&folder);
    }
    let sweep = sweep::read(&folder.join("sweep.yaml"), &[]).expect("the sweep's file reads");
    let records = runs::read(&folder).expect("the sweep's table reads");
    let points = points(&records, sweep.flops.rule);
    let hold_out = match sweep.fit.hold_out {
        HoldOutSpec::LargestBudget => HoldOut::LargestBudget,
        HoldOutSpec::None => HoldOut::None,
    };
    for bootstrap in [0, 1000] {
        let options = FitOptions {
            methods: sweep.fit.minima.clone(),
            flops_rule: sweep.flops.rule.name().into(),
            hold_out,
            bootstrap,
            ..FitOptions::default()
        };
        let name = format!("cmu-motion: isoflop, {bootstrap} replicates");
        case(criterion, &name, || fit(&points, &options).expect("the minima have laws"));
    }
    for bootstrap in [0, 1000] {
        let options = FitOptions {
            name: "cmu-motion".into(),
            flops_rule: sweep.flops.rule.name().into(),
            bootstrap,
            ..FitOptions::default()
        };
        let name = format!("cmu-motion: approach 1, {bootstrap} replicates");
        case(criterion, &name, || approach1(&points, &options).expect("the frontier has laws"));
    }
}

fn a_million_rows(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a folder for the table");
    let path = folder.path().join("million.csv");
    fs::write(&path, synthetic(MILLION)).expect("the table is written");
    let request = TableRequest::default();
    case(criterion, "a million rows: CSV into points", || load(&path, &request));
    let points = load(&path, &request);
    let options = ParametricOptions { bootstrap: 0, ..ParametricOptions::of(Form::Approach3) };
    parametric(criterion, "a million rows: approach 3", &points, &options);
}

/// Runs around L = 1.8 + 480/N^0.35 + 2100/D^0.37, within 1 %.
fn synthetic(rows: usize) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut between =
        |low: f64, high: f64| low + (high - low) * (rng.next_u64() as f64 / 2.0f64.powi(64));
    let mut text = String::from("params,tokens,loss\n");
    for _ in 0..rows {
        let (n, d) = (10f64.powf(between(6.0, 10.0)), 10f64.powf(between(8.0, 12.0)));
        let noise = between(0.99, 1.01);
        let loss = (1.8 + 480.0 * n.powf(-0.35) + 2100.0 * d.powf(-0.37)) * noise;
        writeln!(text, "{n},{d},{loss}").expect("a String takes any text");
    }
    text
}

fn parametric(
    criterion: &mut Criterion,
    name: &str,
    points: &[IsoFlopPoint],
    options: &ParametricOptions,
) {
    case(criterion, name, || fit_parametric(points, options).expect("the rows have a law"));
}

/// Times `run` on one thread.
fn case<T: Send>(criterion: &mut Criterion, name: &str, run: impl Fn() -> T + Sync) {
    let pool = ThreadPoolBuilder::new().num_threads(1).build().expect("a pool of one thread");
    let mut group = criterion.benchmark_group("laws");
    group.sampling_mode(SamplingMode::Flat);
    group.bench_function(name, |bencher| pool.install(|| bencher.iter(&run)));
    group.finish();
}

fn here(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn skipped(path: &Path) {
    println!("skipped: {} is absent", path.display());
}

fn request(columns: &str, filters: &[&str]) -> TableRequest {
    let filters = filters.iter().map(ToString::to_string).collect();
    TableRequest { columns: Some(columns.into()), filters, ..TableRequest::default() }
}

/// The points of a table made elsewhere; none where it is absent.
fn shared(path: &str, request: &TableRequest) -> Option<Vec<IsoFlopPoint>> {
    let path = here("../shared/data/runs").join(path);
    if !path.exists() {
        skipped(&path);
        return None;
    }
    Some(load(&path, request))
}

fn load(path: &Path, request: &TableRequest) -> Vec<IsoFlopPoint> {
    let table = table::read(path).expect("the table reads");
    table::load(&table, request).expect("its rows are runs").points
}

/// The records of a sweep as its laws see them.
fn points(records: &[RunRecord], rule: FlopsRule) -> Vec<IsoFlopPoint> {
    let point = |record: &RunRecord| record.point(rule, &Metric::default());
    records.iter().map(point).collect::<Result<_, _>>().expect("the sweep's records are whole")
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .warm_up_time(Duration::from_secs(1))
        .measurement_time(Duration::from_secs(3))
        .sample_size(10);
    targets = chinchilla, collection, vocabulary, sweep_of_motion, a_million_rows
}
criterion_main!(benches);
