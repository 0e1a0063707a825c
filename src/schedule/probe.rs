//! How long a plan takes here: a few real training steps, then arithmetic.

use std::time::{Duration, Instant};

use burn::optim::GradientsParams;
use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::job::tokenizer_cost;
use crate::model::{Batch, Model, Sequence, end_token};
use crate::plan::flops::openai_per_token;
use crate::plan::{ModelShape, PlannedRun, TokenizerJob, Trunk};
use crate::train::adamw::{AdamW, AdamWConfig};

/// Models measured at most, from the smallest to the largest.
const PROBES: usize = 4;
/// Larger models are measured at a smaller size, and priced at the rate found there.
const MOST_PARAMS: usize = 4_000_000;
/// Tokens of a measured step at most, and logits.
const MOST_TOKENS: usize = 1024;
const MOST_LOGITS: usize = 1 << 24;
const PROBE_TIME: Duration = Duration::from_millis(300);
/// A caption's words and a clip's codes, for the batches of the probe.
const PROBE_TEXT: usize = 12;
const PROBE_CODES: usize = 36;

/// Hours that the runs, their trunks and the tokenizers they wait for take on `slots` slots, by training steps
/// measured now on one thread. Tokenizers are priced at the best rate measured.
pub fn hours(
    runs: &[&PlannedRun],
    trunks: &[&Trunk],
    tokenizers: &[&TokenizerJob],
    device: &Device,
    slots: usize,
) -> f64 {
    let rates = on_one_thread(|| measure(runs, device));
    let first = tokenizer_seconds(tokenizers, &rates);
    let seconds = |run: &&PlannedRun| run.own_flops() / rate_at(&rates, run.params.total());
    let shared = |trunk: &&Trunk| {
        let params = trunk.spec.model.params(trunk.spec.n_vocab);
        trunk.flops / rate_at(&rates, params.total())
    };
    let shared: f64 = trunks.iter().map(shared).sum();
    let together: f64 = first + shared + runs.iter().map(seconds).sum::<f64>();
    let longest = runs.iter().map(seconds).fold(0.0, f64::max);
    (together / slots as f64).max(longest) / 3600.0
}

/// Hours that tokenizers take on `slots` slots, where a program of somebody's own trains the runs.
pub fn tokenizer_hours(
    runs: &[&PlannedRun],
    tokenizers: &[&TokenizerJob],
    device: &Device,
    slots: usize,
) -> f64 {
    if tokenizers.is_empty() {
        return 0.0;
    }
    let rates = on_one_thread(|| measure(runs, device));
    tokenizer_seconds(tokenizers, &rates) / slots as f64 / 3600.0
}

fn tokenizer_seconds(tokenizers: &[&TokenizerJob], rates: &[(f64, f64)]) -> f64 {
    let best = rates.iter().map(|(_, rate)| *rate).fold(f64::MIN_POSITIVE, f64::max);
    tokenizers.iter().map(|job| tokenizer_cost(job) / best).sum()
}

/// Workers have a thread each, so what they will need is measured on one.
fn on_one_thread<T: Send>(measure: impl FnOnce() -> T + Send) -> T {
    match rayon::ThreadPoolBuilder::new().num_threads(1).build() {
        Ok(pool) => pool.install(measure),
        Err(_) => measure(),
    }
}

/// Parameters and budget FLOPs a second of each probed run, by size.
fn measure(runs: &[&PlannedRun], device: &Device) -> Vec<(f64, f64)> {
    let mut sizes: Vec<_> = runs.iter().collect();
    sizes.sort_by_key(|run| run.params.total());
    sizes.dedup_by_key(|run| run.params.total().min(MOST_PARAMS));
    let last = sizes.len().saturating_sub(1);
    let mut picked: Vec<usize> = (0..PROBES).map(|i| i * last / (PROBES - 1)).collect();
    picked.dedup();
    let rate = |run: &PlannedRun| (run.params.total() as f64, flops_per_second(run, device));
    picked.into_iter().filter_map(|i| sizes.get(i)).map(|run| rate(run)).collect()
}

/// Between probes, linear in logarithms; outside, the nearest.
fn rate_at(rates: &[(f64, f64)], params: usize) -> f64 {
    let x = (params as f64).ln();
    let above = rates.partition_point(|(n, _)| n.ln() < x);
    match (above.checked_sub(1).map(|i| rates[i]), rates.get(above).copied()) {
        (Some((n0, r0)), Some((n1, r1))) => {
            let share = (x - n0.ln()) / (n1.ln() - n0.ln());
            (r0.ln() * (1.0 - share) + r1.ln() * share).exp()
        }
        (Some((_, rate)), None) | (None, Some((_, rate))) => rate,
        (None, None) => f64::INFINITY,
    }
}

/// The run's model, or a smaller one of its kind: fewer layers, then codes, then channels.
///
/// Nothing above the limit is built, so that a plan of billions of parameters can be priced on a
/// machine that could not hold them. Products of such widths run at one rate; what a smaller
/// vocabulary leaves out is of that kind too.
fn measurable(run: &PlannedRun) -> (ModelShape, usize) {
    let (mut model, mut n_vocab) = (run.spec.model.clone(), run.spec.n_vocab);
    let too_large = |model: &ModelShape, n_vocab| model.params(n_vocab).total() > MOST_PARAMS;
    while too_large(&model, n_vocab) && model.n_layer > 1 {
        model.n_layer = model.n_layer.div_ceil(2);
    }
    while too_large(&model, n_vocab) && n_vocab > 1024 {
        n_vocab /= 2;
    }
    while too_large(&model, n_vocab) && model.n_head > 1 {
        let head_dim = model.d_model / model.n_head;
        let n_head = model.n_head / 2;
        model.d_ff = (model.d_ff * n_head / model.n_head).max(1);
        (model.n_head, model.d_model) = (n_head, n_head * head_dim);
    }
    (model, n_vocab)
}

/// Budget FLOPs a second of a run's training step, the best of as many as fit the time.
fn flops_per_second(run: &PlannedRun, device: &Device) -> f64 {
    let (shape, n_vocab) = measurable(run);
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut model = Model::init(&shape, n_vocab, &mut rng, &device.clone().autodiff());
    let mut optimiser = AdamW::new(AdamWConfig {
        beta_1: 0.9,
        beta_2: 0.95,
        epsilon: 1e-8,
        weight_decay: 0.0,
        clip_norm: None,
    });
    let most_tokens = MOST_TOKENS.min(MOST_LOGITS / n_vocab);
    let batch = batch(&shape, n_vocab, run.spec.batch_tokens.min(most_tokens));
    let full = openai_per_token(&run.spec.model, run.spec.n_vocab) as f64;
    let share = openai_per_token(&shape, n_vocab) as f64 / full;
    let flops_per_token = share * run.spec.budget_flops / (run.spec.tokens() as f64);
    let (started, mut best) = (Instant::now(), f64::INFINITY);
    for step in 0.. {
        let at = Instant::now();
        let gradients = GradientsParams::from_grads(model.loss(&batch).backward(), &model.weights);
        model.weights = optimiser.step(model.weights.clone(), gradients, 0.0).0;
        if step > 0 {
            best = best.min(at.elapsed().as_secs_f64());
        }
        if step > 0 && started.elapsed() > PROBE_TIME {
            break;
        }
    }
    flops_per_token * batch.targets.len() as f64 / best
}

/// A step's batch of made-up clips, of an average one's length.
fn batch(shape: &ModelShape, n_vocab: usize, batch_tokens: usize) -> Batch {
    let text = vec![0.5f32; shape.d_text * PROBE_TEXT.min(shape.n_ctx / 2)];
    let n_codes = PROBE_CODES.min(shape.n_ctx / 2);
    let codes: Vec<u32> = (0..n_codes).map(|i| (i * 7 % n_vocab) as u32).collect();
    let clips = batch_tokens.div_ceil(n_codes + 1);
    let sequence = Sequence { text: &text, codes: &codes, from: 0, to: n_codes + 1 };
    Batch::pack(&vec![sequence; clips], shape.d_text, end_token(n_vocab))
}
