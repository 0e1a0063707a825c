//! A training step, own kernels beside plain ones, on one thread: `cargo bench --bench train`.
//!
//! Shapes are those of the quickstart, and of the small models that burn and PyTorch are usually
//! compared on. Read ratios: machines differ.

use std::time::Duration;

use burn::optim::GradientsParams;
use burn::tensor::Device;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use isoflop::model::{Batch, Model, Sequence, Transformer, end_token};
use isoflop::ops::Kernels;
use isoflop::plan::ModelShape;
use isoflop::sweep::Ffn;
use isoflop::train::adamw::{AdamW, AdamWConfig};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Name, layers, heads, width, codes, words of a caption, codes of a clip, clips of a step.
const CASES: [(&str, [usize; 7]); 4] = [
    ("quickstart d16 V240", [2, 1, 16, 240, 16, 36, 7]),
    ("quickstart d32 V1000", [2, 2, 32, 1000, 16, 36, 7]),
    ("motion d64 V1000", [4, 4, 64, 1000, 32, 50, 32]),
    ("S0: 2 layers d64 V512", [2, 2, 64, 512, 1, 63, 32]),
];

fn training_step(criterion: &mut Criterion) {
    for (name, [n_layer, n_head, d_model, n_vocab, n_text, n_codes, clips]) in CASES {
        let shape = shape(n_layer, n_head, d_model, n_text + n_codes + 1);
        let batch = batch(&shape, n_vocab, n_text, n_codes, clips);
        let mut group = criterion.benchmark_group(name);
        group.throughput(Throughput::Elements(batch.targets.len() as u64));
        for kernels in [Kernels::Own, Kernels::Plain] {
            let mut step = stepper(&shape, n_vocab, kernels);
            group.bench_function(format!("{kernels:?}"), |bencher| bencher.iter(|| step(&batch)));
        }
        group.finish();
    }
}

fn shape(n_layer: usize, n_head: usize, d_model: usize, n_ctx: usize) -> ModelShape {
    ModelShape {
        n_layer,
        n_head,
        d_model,
        d_ff: (8 * d_model / 3).next_multiple_of(8),
        n_ctx,
        d_text: 64,
        ffn: Ffn::SwiGlu,
        tie_embeddings: false,
        rope_base: 10_000.0,
    }
}

fn batch(shape: &ModelShape, n_vocab: usize, n_text: usize, n_codes: usize, clips: usize) -> Batch {
    let text = vec![0.5; n_text * shape.d_text];
    let codes: Vec<u32> = (0..n_codes).map(|i| (i * 7 % n_vocab) as u32).collect();
    let sequence = Sequence { text: &text, codes: &codes, from: 0, to: n_codes + 1 };
    Batch::pack(&vec![sequence; clips], shape.d_text, end_token(n_vocab))
}

/// Forward, backward and AdamW, as the training loop does them.
fn stepper(shape: &ModelShape, n_vocab: usize, kernels: Kernels) -> impl FnMut(&Batch) {
    let device = Device::flex().autodiff();
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let weights = Transformer::init(shape, n_vocab, &mut rng, &device);
    let mut model = Model::new(weights, shape, n_vocab, kernels, &device);
    let mut optimiser = AdamW::new(AdamWConfig {
        beta_1: 0.9,
        beta_2: 0.95,
        epsilon: 1e-8,
        weight_decay: 1e-6,
        clip_norm: Some(1.0),
    });
    move |batch| {
        let gradients = model.loss(batch).backward();
        let gradients = GradientsParams::from_grads(gradients, &model.weights);
        model.weights = optimiser.step(model.weights.clone(), gradients, 1e-3).0;
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().measurement_time(Duration::from_secs(3)).sample_size(20);
    targets = training_step
}
criterion_main!(benches);
