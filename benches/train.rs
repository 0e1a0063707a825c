//! A training step on one thread, own kernels beside plain ones: `cargo bench --bench train`.
//!
//! Shapes are those of the quickstart, those that burn and PyTorch are usually compared on (S0 to
//! S2), and two of motion generation. Read ratios: machines differ.
//!
//! `cargo bench --bench train -- --serve` times steps for another program instead: it reads
//! lines `CASE SECONDS` and answers each by one line of JSON (see [`serve`]).

use std::io::{BufRead, Write};
use std::time::{Duration, Instant};

use burn::optim::GradientsParams;
use burn::tensor::{Device, Distribution, Tensor};
use criterion::{Criterion, Throughput, criterion_group};
use isoflop::generator::autoregressive::{Batch, Model, Sequence, Transformer, end_token};
use isoflop::learn::adamw::{AdamW, AdamWConfig};
use isoflop::ops::Kernels;
use isoflop::spec::Ffn;
use isoflop::spec::ModelShape;
use isoflop::spec::flops::{TRAINING_PER_FORWARD, exact_of_sequence};
use nix::sys::resource::{UsageWho, getrusage};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// One shape to time.
#[derive(Clone, Copy)]
struct Case {
    name: &'static str,
    n_layer: usize,
    n_head: usize,
    d_model: usize,
    n_vocab: usize,
    /// Text vectors before each clip.
    n_text: usize,
    /// Codes of a clip; its targets are one more, the end token.
    n_codes: usize,
    clips: usize,
}

const fn case(name: &'static str, numbers: [usize; 7]) -> Case {
    let [n_layer, n_head, d_model, n_vocab, n_text, n_codes, clips] = numbers;
    Case { name, n_layer, n_head, d_model, n_vocab, n_text, n_codes, clips }
}

const CASES: [Case; 7] = [
    case("quickstart-d16-V240", [2, 1, 16, 240, 16, 36, 7]),
    case("quickstart-d32-V1000", [2, 2, 32, 1000, 16, 36, 7]),
    case("motion-V1000", [4, 4, 64, 1000, 32, 50, 32]),
    case("motion-V64000", [4, 4, 64, 64_000, 32, 50, 32]),
    case("S0", [2, 2, 64, 512, 1, 63, 32]),
    case("S1", [4, 4, 128, 1024, 1, 63, 32]),
    case("S2", [6, 4, 256, 4096, 1, 63, 32]),
];

/// Cases that plain kernels take too long for.
const OWN_ALONE: [&str; 2] = ["motion-V64000", "S2"];

impl Case {
    fn shape(&self) -> ModelShape {
        ModelShape {
            n_layer: self.n_layer,
            n_head: self.n_head,
            d_model: self.d_model,
            d_ff: (8 * self.d_model / 3).next_multiple_of(8),
            n_ctx: self.n_text + self.n_codes + 1,
            d_text: 64,
            ffn: Ffn::SwiGlu,
            tie_embeddings: false,
            rope_base: 10_000.0,
        }
    }

    fn batch(&self, d_text: usize) -> Batch {
        let text = vec![0.5; self.n_text * d_text];
        let codes: Vec<u32> = (0..self.n_codes).map(|i| (i * 7 % self.n_vocab) as u32).collect();
        let sequence = Sequence { text: &text, codes: &codes, from: 0, to: self.n_codes + 1 };
        Batch::pack(&vec![sequence; self.clips], d_text, end_token(self.n_vocab))
    }

    /// Multiply-adds of a step's products, times two.
    fn flops(&self) -> f64 {
        let (prefix, targets) = (self.n_text as f64, (self.n_codes + 1) as f64);
        let forward = exact_of_sequence(&self.shape(), self.n_vocab, prefix, targets);
        self.clips as f64 * forward * TRAINING_PER_FORWARD
    }

    /// Forward, backward, clipping and AdamW, as the training loop does them; gives the loss.
    fn stepper(&self, kernels: Kernels) -> impl FnMut() -> f32 {
        let device = Device::flex().autodiff();
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let shape = self.shape();
        let batch = self.batch(shape.d_text);
        let weights = Transformer::init(&shape, self.n_vocab, &mut rng, &device);
        let mut model = Model::new(weights, &shape, self.n_vocab, kernels, &device);
        let mut optimiser = AdamW::new(AdamWConfig {
            beta_1: 0.9,
            beta_2: 0.95,
            epsilon: 1e-8,
            weight_decay: 1e-6,
            clip_norm: Some(1.0),
        });
        move || {
            let loss = model.loss(&batch);
            let value = loss.clone().into_scalar::<f32>();
            let gradients = GradientsParams::from_grads(loss.backward(), &model.weights);
            model.weights = optimiser.step(model.weights.clone(), gradients, 1e-3).0;
            value
        }
    }
}

fn training_step(criterion: &mut Criterion) {
    for case in CASES {
        let mut group = criterion.benchmark_group(case.name);
        group.throughput(Throughput::Elements((case.clips * (case.n_codes + 1)) as u64));
        for kernels in [Kernels::Own, Kernels::Plain] {
            if kernels == Kernels::Plain && OWN_ALONE.contains(&case.name) {
                continue;
            }
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

/// A product of two matrices of 1024 x 1024, by burn: what the machine gives at best.
fn product() -> impl FnMut() {
    let device = Device::flex();
    let [a, b] = [(); 2].map(|()| Tensor::<2>::random([1024; 2], Distribution::Default, &device));
    move || drop(std::hint::black_box(a.clone().matmul(b.clone())))
}

const PRODUCT_FLOPS: f64 = 2.0 * (1u64 << 30) as f64;

/// Does one training step and gives its loss.
type Stepper = Box<dyn FnMut() -> f32>;

/// Answers each line `CASE SECONDS` (a case of the table, or `product`) by the processor seconds
/// of a step, its seconds by the wall clock, its FLOPs, its supervised tokens and the last loss. What
/// a case needs is made at its first line and kept.
fn serve() {
    let mut steppers: Vec<(&str, Stepper)> = Vec::new();
    for line in std::io::stdin().lock().lines().map_while(Result::ok) {
        let (name, seconds) = line.split_once(' ').expect("CASE SECONDS");
        let seconds = seconds.parse().expect("seconds are a number");
        let mut loss = 0.0;
        let ([step_s, wall_s], flops, tokens) = if name == "product" {
            (timed(&mut product(), seconds), PRODUCT_FLOPS, 0)
        } else {
            let case = CASES.iter().find(|case| case.name == name).expect("a case of the table");
            if !steppers.iter().any(|(made, _)| *made == name) {
                steppers.push((case.name, Box::new(case.stepper(Kernels::Own))));
            }
            let stepper = steppers.iter_mut().find(|(made, _)| *made == name);
            let (_, step) = stepper.expect("just made");
            let tokens = case.clips * (case.n_codes + 1);
            (timed(&mut || loss = step(), seconds), case.flops(), tokens)
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
