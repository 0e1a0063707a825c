//! How a run learns, and how it says that it cannot go on.

mod batches;
#[path = "../support/corpus.rs"]
mod corpus;
mod masked;
#[path = "../support/no_scales.rs"]
mod no_scales;
mod numbered;
mod residual;
mod resumed;
mod scalewise;
mod trained;

use std::ops::ControlFlow;
use std::time::Duration;

use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use burn::optim::GradientsParams;
use corpus::{Corpus, small_run};
use isoflop::generator::autoregressive::{Model, TokenStream, Transformer};
use isoflop::generator::{self, GeneratorError, Network, Trained, Training};
use isoflop::learn::adamw::{AdamW, AdamWConfig};
use isoflop::learn::weights;
use isoflop::learn::{Checkpoints, LearnError};
use isoflop::ops::Kernels;
use isoflop::progress::Step;
use isoflop::spec::ModelShape;
use isoflop::spec::RunSpec;
use isoflop::spec::{Ffn, Precision};
use numbered::{EPOCH_TOKENS, numbered_corpus};
use trained::train_from;

/// Trains over the numbered corpus; the steps that were reported come back too.
fn outcome(change: impl FnOnce(&mut RunSpec)) -> (Result<Trained, GeneratorError>, Vec<usize>) {
    let (corpus, folder) = (numbered_corpus(), tempfile::tempdir().expect("a temporary folder"));
    let mut spec = small_run(40);
    change(&mut spec);
    let mut reported = Vec::new();
    let progress = |Step { step, .. }: Step| {
        reported.push(step);
        ControlFlow::Continue(())
    };
    let result = train_from(&folder.path().join("state"), &spec, &corpus.inputs(), progress);
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
        model.weights = optimiser.step(model.weights.clone(), gradients, 1.0, 3e-3).0;
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
            let (next, norm) = optimiser.step(model.weights, gradients, scale, 3e-3);
            assert!(norm > 0.5, "clipping is tried: {norm}");
            model.weights = next;
        }
        weights::on_host(&weights::of_module(&model.weights))
    };
    assert_eq!(weights(1.0), weights(1024.0));
}
