//! What a run trains on, at which rate, and how it says that it cannot go on.

#[path = "support/corpus.rs"]
mod corpus;

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::time::Duration;

use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use burn::optim::GradientsParams;
use corpus::{Clips, Corpus, small_run};
use isoflop::generator::autoregressive::{Batch, Model, TokenStream, Transformer, learning_rate};
use isoflop::generator::{self, GeneratorError, Trained, Training};
use isoflop::learn::adamw::{AdamW, AdamWConfig};
use isoflop::learn::weights;
use isoflop::learn::{Checkpoints, LearnError};
use isoflop::ops::Kernels;
use isoflop::plan::RunSpec;
use isoflop::progress::Step;
use isoflop::spec::ModelShape;
use isoflop::spec::{Ffn, Precision};

/// Eight clips in which every code stands once, so that a target tells where it is from.
fn numbered_corpus() -> Corpus {
    let mut next = 0..;
    let lengths = [5, 1, 8, 2, 11, 3, 3, 7];
    let clips: Clips = lengths.map(|n| next.by_ref().take(n).collect()).into();
    let captions = |clip| (0..=clip % 4).map(|i| format!("{clip} {}", "on ".repeat(i))).collect();
    Corpus::new(40, [clips.clone(), clips.clone(), clips], captions)
}

const EPOCH_TOKENS: usize = 40 + 8;
const END: u32 = 40;

/// Each target of a batch with the code before it, or none after the text.
fn targets(batch: &Batch) -> Vec<(Option<u32>, u32)> {
    let n_text = batch.order.len() - batch.codes.len();
    let before = |&row: &u32| {
        let source = batch.order[row as usize] as usize;
        source.checked_sub(n_text).map(|code| batch.codes[code])
    };
    batch.target_rows.iter().map(before).zip(batch.targets.iter().copied()).collect()
}

/// How often each target is met in an epoch, counted in the corpus.
fn counts_of_corpus(corpus: &Corpus) -> HashMap<(Option<u32>, u32), usize> {
    let mut counts = HashMap::new();
    for clip in 0..8 {
        let codes = corpus.tokens.clip(isoflop::data::Split::Train, clip);
        let before = std::iter::once(None).chain(codes.iter().copied().map(Some));
        let after = codes.iter().copied().chain([END]);
        before.zip(after).for_each(|pair| *counts.entry(pair).or_default() += 1);
    }
    counts
}

#[test]
fn an_epoch_supervises_every_target_once() {
    let corpus = numbered_corpus();
    let mut stream = TokenStream::new(&corpus.tokens, &corpus.text, 9);
    assert_eq!(stream.epoch_tokens(), EPOCH_TOKENS);
    // Seven does not divide the epoch: 48 batches of it are 7 epochs.
    let met: Vec<_> =
        (0..EPOCH_TOKENS).flat_map(|step| targets(&stream.batch(7 * step, 7))).collect();
    assert_eq!(met.len(), 7 * EPOCH_TOKENS);
    let expected = counts_of_corpus(&corpus);
    for epoch in met.chunks(EPOCH_TOKENS) {
        let mut counts = HashMap::new();
        epoch.iter().for_each(|target| *counts.entry(*target).or_default() += 1);
        assert_eq!(counts, expected);
    }
    assert_ne!(met[..EPOCH_TOKENS], met[EPOCH_TOKENS..2 * EPOCH_TOKENS], "epochs are shuffled");
}

/// All that a batch says, as text.
fn written(batch: &Batch) -> String {
    format!("{batch:?}")
}

#[test]
fn a_batch_does_not_depend_on_what_was_asked_before() {
    let corpus = numbered_corpus();
    let stream = |seed| TokenStream::new(&corpus.tokens, &corpus.text, seed);
    let mut forwards = stream(9);
    let batches: Vec<_> = (0..30).map(|i| written(&forwards.batch(13 * i, 13))).collect();
    let mut backwards = stream(9);
    for i in (0..30).rev() {
        backwards.batch(1000 - i, 3);
        assert_eq!(written(&backwards.batch(13 * i, 13)), batches[i], "batch {i}");
    }
    let mut other = stream(10);
    let others: Vec<_> = (0..30).map(|i| written(&other.batch(13 * i, 13))).collect();
    assert_ne!(others, batches, "the seed shuffles");
}

#[test]
fn a_batch_longer_than_an_epoch_goes_on_into_the_next() {
    let corpus = numbered_corpus();
    let mut stream = TokenStream::new(&corpus.tokens, &corpus.text, 9);
    let long = targets(&stream.batch(11, 2 * EPOCH_TOKENS));
    let short = (0..2 * EPOCH_TOKENS).flat_map(|i| targets(&stream.batch(11 + i, 1)));
    assert_eq!(long, short.collect::<Vec<_>>());
}

#[test]
fn the_rate_warms_up_in_equal_steps_and_decays_along_a_cosine() {
    let spec = RunSpec { steps: 110, warmup_steps: 10, lr: 0.02, final_share: 0.1, ..small_run(9) };
    let rates: Vec<f64> = (0..=spec.steps).map(|step| learning_rate(&spec, step)).collect();
    let close = |a: f64, b: f64| (a - b).abs() < 1e-15;
    assert!(rates.iter().all(|rate| (0.0..=spec.lr).contains(rate)));
    assert!(rates[0] > 0.0 && rates[10] == spec.lr, "the first step moves, the peak is reached");
    assert!(rates[..=10].windows(3).all(|r| close(r[1] - r[0], r[2] - r[1])), "{rates:?}");
    assert!(rates[10..].windows(2).all(|r| r[1] < r[0]), "{rates:?}");
    // Half a cosine is odd about its middle, and a third of the way it has lost a quarter.
    assert!((0..=100).all(|i| close(rates[10 + i] + rates[110 - i], 1.1 * spec.lr)), "{rates:?}");
    let thirds = RunSpec { steps: 100, ..spec };
    assert!(close(learning_rate(&thirds, 40), 0.02 * (0.1 + 0.9 * 0.75)));
}

#[test]
fn a_wsd_rate_stays_at_its_peak_until_it_decays() {
    let spec = RunSpec {
        steps: 110,
        warmup_steps: 10,
        lr: 0.02,
        final_share: 0.1,
        decay_steps: Some(25),
        ..small_run(9)
    };
    let rates: Vec<f64> = (0..=spec.steps).map(|step| learning_rate(&spec, step)).collect();
    let close = |a: f64, b: f64| (a - b).abs() < 1e-15;
    assert!(rates[..=10].windows(2).all(|r| r[1] > r[0]), "{rates:?}");
    assert!(rates[10..=85].iter().all(|rate| *rate == spec.lr), "{rates:?}");
    assert!(rates[85..].windows(2).all(|r| r[1] < r[0]), "{rates:?}");
    // 1 − √(1/25), 1 − √(9/25), and the final share.
    for (step, height) in [(86, 0.8), (94, 0.4), (110, 0.0)] {
        assert!(close(rates[step], 0.02 * (0.1 + 0.9 * height)), "{rates:?}");
    }
    let trunk = spec.trunk().expect("it decays");
    assert_eq!(trunk.steps, 85);
    assert!((0..85).all(|step| learning_rate(&trunk, step) == rates[step]));
}

#[test]
fn without_warm_up_the_rate_starts_at_its_peak() {
    let spec = RunSpec { warmup_steps: 0, ..small_run(9) };
    assert_eq!(learning_rate(&spec, 0), spec.lr);
    assert!(learning_rate(&spec, 1) < spec.lr);
}

/// Trains over the numbered corpus; the steps that were reported come back too.
fn outcome(change: impl FnOnce(&mut RunSpec)) -> (Result<Trained, GeneratorError>, Vec<usize>) {
    let (corpus, folder) = (numbered_corpus(), tempfile::tempdir().expect("a temporary folder"));
    let mut spec = small_run(40);
    change(&mut spec);
    let mut reported = Vec::new();
    let mut progress = |Step { step, .. }: Step| {
        reported.push(step);
        ControlFlow::Continue(())
    };
    let (checkpoint, hour) = (folder.path().join("state"), Duration::from_secs(3600));
    let inputs = corpus.inputs();
    let checkpoints = Checkpoints { path: &checkpoint, every: hour, branch: None };
    let result = generator::train(
        &Training {
            spec: &spec,
            inputs: &inputs,
            device: &Device::flex(),
            checkpoints: &checkpoints,
        },
        &mut progress,
    );
    (result, reported)
}

fn error(change: impl FnOnce(&mut RunSpec)) -> (GeneratorError, Vec<usize>) {
    let (result, reported) = outcome(change);
    (result.err().expect("the run cannot end well"), reported)
}

#[test]
fn a_rate_far_too_high_is_told_as_divergence_with_its_step() {
    let (error, reported) = error(|spec| spec.lr = 1e3);
    let GeneratorError::Learn(LearnError::Diverged { step, loss, .. }) = error else {
        panic!("{error}")
    };
    assert_eq!(reported, (1..step).collect::<Vec<_>>(), "the step before was the last good one");
    assert!(loss > 3.0 + 41f64.ln());
    let message = error.to_string();
    assert!(message.contains(&format!("at step {step} of 13")), "{message}");
    assert!(message.contains("lower train.lr"), "{message}");
}

#[test]
fn a_loss_that_is_no_number_is_told_with_its_step() {
    let (error, reported) = error(|spec| spec.lr = 1e39);
    let GeneratorError::Learn(LearnError::NonFinite { step, loss, .. }) = error else {
        panic!("{error}")
    };
    assert!(!loss.is_finite());
    assert_eq!(reported, (1..step).collect::<Vec<_>>());
    let message = error.to_string();
    assert!(message.contains(&format!("at step {step} of 13: lower train.lr")), "{message}");
}

#[test]
fn an_update_that_spoils_the_last_step_is_no_result() {
    for evaluations in [0, 1] {
        let (error, _) = error(|spec| {
            *spec = RunSpec { steps: 1, warmup_steps: 0, lr: 1e39, evaluations, ..spec.clone() };
        });
        assert!(
            matches!(error, GeneratorError::Learn(LearnError::NonFinite { step: 1, steps: 1, .. })),
            "{error}"
        );
    }
}

/// Steps of one target: some read text alone, and then the embedding has no gradient.
#[test]
fn steps_without_a_code_among_their_inputs_train() {
    let change = |spec: &mut RunSpec| (spec.batch_tokens, spec.steps) = (1, 2 * EPOCH_TOKENS);
    let (trained, reported) = outcome(change);
    let trained = trained.expect("an ordinary run");
    assert_eq!(reported.len(), 2 * EPOCH_TOKENS);
    assert!(trained.test.loss_nats < 41f64.ln(), "it learns something: {:?}", trained.test);
}

#[test]
fn a_clip_beyond_the_context_is_named_before_the_first_step() {
    // Clip 4 is the longest: 11 codes after a caption of its number and the end, 2 vectors.
    let (error, reported) = error(|spec| spec.generator.shape_mut().n_ctx = 12);
    assert!(reported.is_empty());
    let message = error.to_string();
    assert!(message.contains("clip 4 of the train split takes 13 positions"), "{message}");
    assert!(message.contains("raise model.motion_slots by 1"), "{message}");
    let (fits, _) = outcome(|spec| spec.generator.shape_mut().n_ctx = 13);
    assert!(fits.is_ok());
}

#[test]
fn tokens_of_another_codebook_are_refused() {
    let (error, _) = error(|spec| spec.codes.scales[0].n_vocab = 41);
    let message = error.to_string();
    assert!(message.contains("40 codes") && message.contains("wants 41"), "{message}");
}

/// The loss of each of the first steps of a small run.
fn losses(corpus: &Corpus, shape: &ModelShape, kernels: Kernels, steps: usize) -> Vec<f64> {
    let device = Device::flex().autodiff();
    let weights = Transformer::init(shape, 40, &mut ChaCha8Rng::seed_from_u64(3), &device);
    let mut model = Model::new(weights, shape, 40, kernels, &device);
    let mut stream = TokenStream::new(&corpus.tokens, &corpus.text, 9);
    let mut optimiser = AdamW::new(AdamWConfig {
        beta_1: 0.9,
        beta_2: 0.95,
        epsilon: 1e-8,
        weight_decay: 0.1,
        clip_norm: Some(1.0),
    });
    let mut step = |step: usize| {
        let loss = model.loss(&stream.batch(20 * step, 20));
        let gradients = GradientsParams::from_grads(loss.clone().backward(), &model.weights);
        model.weights = optimiser.step(model.weights.clone(), gradients, 3e-3).0;
        f64::from(loss.into_scalar::<f32>())
    };
    (0..steps).map(&mut step).collect()
}

#[test]
fn own_kernels_train_as_their_plain_twins_do() {
    let corpus = numbered_corpus();
    for (ffn, tie_embeddings) in [(Ffn::SwiGlu, false), (Ffn::SwiGlu, true), (Ffn::Gelu, false)] {
        let shape = ModelShape { ffn, tie_embeddings, ..small_run(9).shape().clone() };
        let [own, plain] =
            [Kernels::Own, Kernels::Plain].map(|kernels| losses(&corpus, &shape, kernels, 20));
        assert!(own[19] < own[0] - 0.1, "{ffn:?}: learns, {own:?}");
        let off = own.iter().zip(&plain).map(|(own, plain)| ((own - plain) / plain).abs());
        let worst = off.fold(0.0, f64::max);
        assert!(worst < 1e-5, "{ffn:?}, tied: {tie_embeddings}: off by {worst:.1e}");
        assert_eq!(own, losses(&corpus, &shape, Kernels::Own, 20), "{ffn:?}: the same bits again");
    }
}

/// Half the digits lose a little of what a model learns, and no more.
#[test]
fn half_precisions_train_nearly_as_single_does() {
    let loss = |precision| {
        let change = |spec: &mut RunSpec| {
            *spec = RunSpec { precision, steps: 150, lr: 1e-2, ..spec.clone() };
        };
        outcome(change).0.expect("an ordinary run").test.loss_nats
    };
    let single = loss(Precision::F32);
    assert!(single < 41f64.ln() - 0.5, "it learns something: {single}");
    for (precision, tolerance) in [(Precision::F16, 0.02), (Precision::Bf16, 0.1)] {
        let half = loss(precision);
        assert!((half - single).abs() < tolerance, "{precision:?}: {half}, not {single}");
        assert!(half != single, "{precision:?} was not computed in");
    }
}

#[test]
fn a_precision_that_a_device_lacks_is_named() {
    let (corpus, folder) = (numbered_corpus(), tempfile::tempdir().expect("a temporary folder"));
    let spec = RunSpec { precision: Precision::Bf16, ..small_run(40) };
    let checkpoint = folder.path().join("state");
    let checkpoints =
        Checkpoints { path: &checkpoint, every: Duration::from_secs(3600), branch: None };
    let mut never = |_: Step| panic!("a step was done");
    #[expect(deprecated, reason = "the only device of every build that lacks one")]
    let device = Device::ndarray();
    let refused = generator::train(
        &Training {
            spec: &spec,
            inputs: &corpus.inputs(),
            device: &device,
            checkpoints: &checkpoints,
        },
        &mut never,
    );
    let error = refused.err().expect("ndarray has no bf16").to_string();
    assert_eq!(error, "the device does not compute in bf16: set train.precision to f16 or f32");
}

#[test]
fn a_power_of_two_on_the_loss_changes_no_bit() {
    let corpus = numbered_corpus();
    let weights = |scale: f64| {
        let device = Device::flex().autodiff();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut model = Model::init(small_run(40).shape(), 40, &mut rng, &device);
        let mut stream = TokenStream::new(&corpus.tokens, &corpus.text, 9);
        let config = AdamWConfig {
            beta_1: 0.9,
            beta_2: 0.95,
            epsilon: 1e-8,
            weight_decay: 0.1,
            clip_norm: Some(0.5),
        };
        let mut optimiser = AdamW::new(config);
        for step in 0..5 {
            let loss = model.loss(&stream.batch(20 * step, 20)) * scale;
            let gradients = GradientsParams::from_grads(loss.backward(), &model.weights);
            let (next, norm) = optimiser.step_scaled(model.weights, gradients, scale, 3e-3);
            assert!(norm > 0.5, "clipping is tried: {norm}");
            model.weights = next;
        }
        weights::on_host(&weights::of_module(&model.weights))
    };
    assert_eq!(weights(1.0), weights(1024.0));
}
