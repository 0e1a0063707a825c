//! A training step on one thread, own kernels beside plain ones: `cargo bench --bench train`.
//!
//! Shapes of the autoregressive transformer are those of the quickstart, those that burn and PyTorch are
//! usually compared on (S0 to S2), and two of motion generation; those of the scale-by-scale transformer
//! and of the transformer tokenizer are a small one, a middle one and LG-Tok's own. Read ratios: machines
//! differ.
//!
//! `cargo bench --bench train -- --serve` times steps for another program instead: it reads
//! lines `CASE SECONDS` and answers each by one line of JSON (see [`serve`]).

mod autoregressive;
mod peak;
mod scalewise;
mod tokenizer;

use std::io::{BufRead, Write};
use std::time::{Duration, Instant};

use criterion::{Criterion, Throughput, criterion_group};
use isoflop::learn::adamw::{AdamW, AdamWConfig};
use isoflop::ops::Kernels;
use nix::sys::resource::{UsageWho, getrusage};

use self::peak::{LIMIT_FLOPS, PRODUCT_FLOPS};

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Does one training step and gives its loss.
type Stepper = Box<dyn FnMut() -> f32>;

/// A model and a batch to time.
trait Case {
    fn name(&self) -> &'static str;

    /// The kernels that are timed; own ones first.
    fn kernels(&self) -> &[Kernels];

    /// Supervised codes of a step, or frames of a tokenizer's.
    fn tokens(&self) -> usize;

    /// Multiply-adds of a step's products, times two.
    fn flops(&self) -> f64;

    /// Forward, backward, clipping and AdamW, as the training loop does them.
    fn stepper(&self, kernels: Kernels) -> Stepper;
}

fn cases() -> Vec<Box<dyn Case>> {
    let boxed = |case: autoregressive::Autoregressive| -> Box<dyn Case> { Box::new(case) };
    let mut cases: Vec<Box<dyn Case>> = autoregressive::CASES.map(boxed).into();
    cases.extend(scalewise::cases().map(|case| -> Box<dyn Case> { Box::new(case) }));
    cases.extend(tokenizer::cases().map(|case| -> Box<dyn Case> { Box::new(case) }));
    cases
}

fn optimiser() -> AdamW {
    AdamW::new(AdamWConfig {
        beta_1: 0.9,
        beta_2: 0.95,
        epsilon: 1e-8,
        weight_decay: 1e-6,
        clip_norm: Some(1.0),
    })
}

fn training_step(criterion: &mut Criterion) {
    for case in cases() {
        let mut group = criterion.benchmark_group(case.name());
        group.throughput(Throughput::Elements(case.tokens() as u64));
        for &kernels in case.kernels() {
            let mut step = case.stepper(kernels);
            group.bench_function(format!("{kernels:?}"), |bencher| bencher.iter(&mut step));
        }
        group.finish();
    }
}

/// Seconds of processor time this process has taken: what else runs on the core is not in it.
fn processor_s() -> f64 {
    let usage = getrusage(UsageWho::RUSAGE_SELF).expect("a process may ask for its own usage");
    let seconds = |t: nix::sys::time::TimeVal| t.tv_sec() as f64 + t.tv_usec() as f64 * 1e-6;
    seconds(usage.user_time()) + seconds(usage.system_time())
}

/// Calls `step` for about `seconds`, at least three times; the medians of processor seconds and of
/// seconds by the wall clock that a call takes.
fn timed(step: &mut dyn FnMut(), seconds: f64) -> [f64; 2] {
    let (started, mut times) = (Instant::now(), [Vec::new(), Vec::new()]);
    while times[0].len() < 3 || started.elapsed().as_secs_f64() < seconds {
        let before = (processor_s(), Instant::now());
        step();
        times[0].push(processor_s() - before.0);
        times[1].push(before.1.elapsed().as_secs_f64());
    }
    times.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    })
}

/// What a core gives at best, to hold a step's products against: seconds of a call, and its FLOPs.
fn peak(name: &str, seconds: f64) -> Option<([f64; 2], f64)> {
    match name {
        "product" => Some((timed(&mut peak::product(Kernels::Plain), seconds), PRODUCT_FLOPS)),
        "own-product" => Some((timed(&mut peak::product(Kernels::Own), seconds), PRODUCT_FLOPS)),
        "limit" => Some((timed(&mut peak::limit()?, seconds), LIMIT_FLOPS)),
        _ => None,
    }
}

/// Answers each line `CASE SECONDS` (a case of the table, or one of [`peak`]) by the processor seconds
/// of a step, its seconds by the wall clock, its FLOPs, its supervised tokens and the last loss. What
/// a case needs is made at its first line and kept.
fn serve() {
    let cases = cases();
    let mut steppers: Vec<(&str, Stepper)> = Vec::new();
    for line in std::io::stdin().lock().lines().map_while(Result::ok) {
        let (name, seconds) = line.split_once(' ').expect("CASE SECONDS");
        let seconds = seconds.parse().expect("seconds are a number");
        let mut loss = 0.0;
        let ([step_s, wall_s], flops, tokens) = if let Some((times, flops)) = peak(name, seconds) {
            (times, flops, 0)
        } else {
            let case = cases.iter().find(|case| case.name() == name).expect("a case of the table");
            if !steppers.iter().any(|(made, _)| *made == name) {
                steppers.push((case.name(), case.stepper(Kernels::Own)));
            }
            let stepper = steppers.iter_mut().find(|(made, _)| *made == name);
            let (_, step) = stepper.expect("just made");
            (timed(&mut || loss = step(), seconds), case.flops(), case.tokens())
        };
        println!(
            "{{\"step_s\": {step_s:e}, \"wall_s\": {wall_s:e}, \"flops\": {flops:e}, \
             \"tokens\": {tokens}, \"loss\": {loss}}}"
        );
        std::io::stdout().flush().expect("whoever asked still listens");
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().measurement_time(Duration::from_secs(3)).sample_size(20);
    targets = training_step
}

fn main() {
    if std::env::args().any(|argument| argument == "--serve") {
        return serve();
    }
    benches();
    Criterion::default().configure_from_args().final_summary();
}
