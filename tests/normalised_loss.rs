//! The normalised loss L_u where its value is known: a unigram model, and a Markov chain.

#[path = "support/corpus.rs"]
mod corpus;

use std::ops::ControlFlow;
use std::time::Duration;

use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use corpus::{Clips, Corpus, small_run};
use isoflop::data::{Split, UNIT_FRAMES};
use isoflop::draws::{below, unit};
use isoflop::generator::autoregressive::{Model, Transformer, split_loss};
use isoflop::generator::{self, Training};
use isoflop::learn::Checkpoints;
use isoflop::learn::weights;
use isoflop::ops::Kernels;
use isoflop::progress::Step;
use isoflop::spec::RunSpec;
use isoflop::spec::{GeneratorSpec, ModelShape};

/// An index drawn with these probabilities.
fn draw(probs: &[f64], rng: &mut ChaCha8Rng) -> u32 {
    let mut left = unit(rng);
    let found = probs.iter().position(|p| {
        left -= p;
        left < 0.0
    });
    found.unwrap_or(probs.len() - 1) as u32
}

fn normalise(mut weights: Vec<f64>) -> Vec<f64> {
    let total: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|w| *w /= total);
    weights
}

const ZIPF_VOCAB: usize = 50;

/// Codes by Zipf's law; the rarest ten stand in the test split alone.
fn zipf_corpus() -> Corpus {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut clips = |n_clips: usize, n_vocab: usize| -> Clips {
        let probs = normalise((1..=n_vocab).map(|rank| (rank as f64).powf(-1.2)).collect());
        let mut clip = || (0..=below(&mut rng, 30)).map(|_| draw(&probs, &mut rng)).collect();
        (0..n_clips).map(|_| clip()).collect()
    };
    let splits = [clips(400, ZIPF_VOCAB - 10), clips(5, ZIPF_VOCAB), clips(300, ZIPF_VOCAB)];
    let captions = |clip| (0..=clip % 3).map(|i| format!("turns {i} times")).collect();
    Corpus::new(ZIPF_VOCAB, splits, captions)
}

/// A model whose logits are `log_probs` whatever it reads: the blocks add nothing to a stream of
/// ones, the last gain undoes the ε of the norm, and the head reads one feature.
fn constant_model(log_probs: &[f64], kernels: Kernels) -> Model {
    let (shape, device) = (small_run(ZIPF_VOCAB).shape().clone(), Device::flex());
    let drawn = Transformer::init(&shape, ZIPF_VOCAB, &mut ChaCha8Rng::seed_from_u64(0), &device);
    let mut weights = weights::on_host(&weights::of_module(&drawn));
    for (name, tensor) in &mut weights {
        let values = &mut tensor.values;
        match name.rsplit('.').next().expect("a name") {
            "embedding" | "text_bias" => values.fill(1.0),
            "text_weight" | "output" | "down" | "head" => values.fill(0.0),
            "norm" => values.fill(1.00001f32.sqrt()),
            _ => {}
        }
    }
    let head = &mut weights.get_mut("head").expect("untied").values;
    head.iter_mut().zip(log_probs).for_each(|(weight, log_prob)| *weight = *log_prob as f32);
    let weights = weights::into_module(drawn, weights).expect("its own weights");
    Model::new(weights, &shape, ZIPF_VOCAB, kernels, &device)
}

#[test]
fn a_unigram_model_scores_zero() {
    let corpus = zipf_corpus();
    let tokens = &corpus.tokens;
    assert!(tokens.zero_count_targets() > 20, "smoothing must matter");
    for kernels in [Kernels::Own, Kernels::Plain] {
        let model = constant_model(&tokens.unigram_log_probs(0), kernels);
        let loss = split_loss(&model, &corpus.inputs(), Split::Test);
        assert!(loss.targets > 2 * 2048, "{} targets must take several passes", loss.targets);
        assert!(loss.loss_normalised.abs() < 1e-6, "{kernels:?}: {}", loss.loss_normalised);
    }
}

#[test]
fn a_model_that_knows_nothing_scores_the_logarithm_of_the_vocabulary() {
    let corpus = zipf_corpus();
    let tokens = &corpus.tokens;
    let model = constant_model(&[0.0; ZIPF_VOCAB + 1], Kernels::Own);
    let loss = split_loss(&model, &corpus.inputs(), Split::Test);
    let (targets, codes) = (tokens.n_tokens(Split::Test) + 300, tokens.n_tokens(Split::Test));
    let nats = 51f64.ln();
    let nats_per_frame = nats * targets as f64 / (UNIT_FRAMES * codes) as f64;
    assert_eq!(loss.targets, targets);
    assert!((loss.loss_nats - nats).abs() < 1e-6, "{loss:?}");
    assert!((loss.nats_per_frame - nats_per_frame).abs() < 1e-6, "{loss:?}");
    assert!(loss.loss_normalised > 0.5, "Zipf's law tells something: {loss:?}");
    assert_eq!(loss.likeliest_exponential_entropy, [1.0], "equal codes: always the first");
}

const CHAIN_VOCAB: usize = 24;

/// A Markov chain of first order over codes and, last, the end.
struct Chain {
    first: Vec<f64>,
    next: Vec<Vec<f64>>,
}

impl Chain {
    const END_PROB: f64 = 1.0 / 12.0;

    fn draw(rng: &mut ChaCha8Rng) -> Self {
        let row = |rng: &mut ChaCha8Rng| {
            normalise((0..CHAIN_VOCAB).map(|_| unit(rng).powi(6) + 1e-3).collect())
        };
        let first = row(rng);
        let with_end = |row: Vec<f64>| {
            let codes = row.into_iter().map(|p| p * (1.0 - Self::END_PROB));
            codes.chain([Self::END_PROB]).collect()
        };
        Self { first, next: (0..CHAIN_VOCAB).map(|_| with_end(row(rng))).collect() }
    }

    fn clip(&self, rng: &mut ChaCha8Rng) -> Vec<u32> {
        let mut codes = vec![draw(&self.first, rng)];
        loop {
            match draw(&self.next[codes[codes.len() - 1] as usize], rng) {
                code if (code as usize) < CHAIN_VOCAB => codes.push(code),
                _ => return codes,
            }
        }
    }

    /// −ln p of a clip and its end, in nats.
    fn nll(&self, clip: &[u32]) -> f64 {
        let steps = clip.windows(2).map(|pair| self.next[pair[0] as usize][pair[1] as usize]);
        let probs = [self.first[clip[0] as usize], Self::END_PROB].into_iter().chain(steps);
        -probs.map(f64::ln).sum::<f64>()
    }

    /// Its L_u on `test`, with the unigram counts of `train`: exact, without any model.
    fn loss_normalised(&self, train: &Clips, test: &Clips) -> f64 {
        let mut counts = [1.0; CHAIN_VOCAB + 1];
        train.iter().flatten().for_each(|&code| counts[code as usize] += 1.0);
        counts[CHAIN_VOCAB] += train.len() as f64;
        let probs = normalise(counts.to_vec());
        let unigram = |clip: &Vec<u32>| -> f64 {
            let codes = clip.iter().map(|&code| probs[code as usize].ln());
            codes.sum::<f64>() + probs[CHAIN_VOCAB].ln()
        };
        let total: f64 = test.iter().map(|clip| self.nll(clip) + unigram(clip)).sum();
        total / test.iter().map(|clip| clip.len() + 1).sum::<usize>() as f64
    }
}

/// A run that sees each of its 500 thousand targets at most once.
fn chain_run() -> RunSpec {
    let base = small_run(CHAIN_VOCAB);
    let model = ModelShape {
        n_layer: 1,
        n_head: 4,
        d_model: 32,
        d_ff: 64,
        n_ctx: 300,
        ..base.shape().clone()
    };
    RunSpec {
        generator: GeneratorSpec::Autoregressive(model),
        batch_tokens: 512,
        steps: 1000,
        lr: 1e-2,
        warmup_steps: 50,
        final_share: 0.0,
        weight_decay: 0.0,
        evaluations: 1,
        ..base
    }
}

#[test]
fn training_on_a_markov_chain_reaches_the_loss_of_the_chain() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let chain = Chain::draw(&mut rng);
    let splits = [42_000, 50, 2_000].map(|n| (0..n).map(|_| chain.clip(&mut rng)).collect());
    let expected = chain.loss_normalised(&splits[0], &splits[2]);
    let corpus = Corpus::new(CHAIN_VOCAB, splits, |_| vec![String::new()]);
    let (folder, spec) = (tempfile::tempdir().expect("a temporary folder"), chain_run());
    let targets = corpus.tokens.n_tokens(Split::Train) + corpus.tokens.n_clips(Split::Train);
    assert!(targets > spec.tokens(), "data must not repeat");
    let checkpoint = folder.path().join("state.safetensors");
    let mut go_on = |_: Step| ControlFlow::Continue(());
    let hour = Duration::from_secs(3600);
    let inputs = corpus.inputs();
    let checkpoints = Checkpoints { path: &checkpoint, every: hour, branch: None };
    let trained = generator::train(
        &Training {
            spec: &spec,
            inputs: &inputs,
            device: &Device::flex(),
            checkpoints: &checkpoints,
        },
        &mut go_on,
    )
    .expect("an ordinary run");
    let found = trained.test.loss_normalised;
    eprintln!("L_u {found:.4}, the chain's own {expected:.4}, in {:.1} s", trained.wall_s);
    assert!(expected < -0.7, "the chain must say more than its unigrams: {expected}");
    assert!((found - expected).abs() < 0.01, "{found} against the chain's {expected}");
}
