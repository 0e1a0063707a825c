//! The transformer's logits, loss and gradients, and the parameters after some steps of AdamW,
//! against an implementation in JAX and float64.
//!
//! `fixtures/reference/make.py` writes the numbers. It pads and masks densely where the library
//! packs, so that a mistake in either way of laying out a batch shows. Parameters are exact in
//! `f32`; what is left is the library's rounding, which reaches 2e-6 of a tensor's norm.

#[path = "support/reference.rs"]
mod reference;

use burn::optim::GradientsParams;
use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::Deserialize;

use isoflop::generator::Network;
use isoflop::generator::autoregressive::{Batch, Model, Sequence, Transformer, end_token};
use isoflop::learn::adamw::{AdamW, AdamWConfig};
use isoflop::learn::weights::{self, HostTensor, Source, Weights};
use isoflop::ops::Kernels;
use isoflop::spec::ModelShape;
use reference::{Reference, TOLERANCE, gradients, relative_error};

const VARIANTS: [&str; 2] = ["swiglu-untied", "gelu-tied"];

/// What stands in a file of reference values beside its tensors.
#[derive(Deserialize)]
struct Notes {
    shape: ModelShape,
    n_vocab: usize,
    adamw: Steps,
    sequences: Vec<Supervised>,
    loss: f64,
}

#[derive(Deserialize)]
struct Steps {
    steps: usize,
    lr: f64,
    betas: [f64; 2],
    epsilon: f64,
    weight_decay: f64,
    clip_norm: f64,
}

#[derive(Deserialize)]
struct Supervised {
    codes: Vec<u32>,
    from: usize,
    to: usize,
}

fn read(variant: &str) -> Reference<Notes> {
    Reference::read("reference", variant)
}

impl Reference<Notes> {
    fn model(&self, kernels: Kernels, device: &Device) -> Model {
        let Notes { shape, n_vocab, .. } = &self.notes;
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let drawn = Transformer::init(shape, *n_vocab, &mut rng, device);
        Model::new(self.parameters(drawn), shape, *n_vocab, kernels, device)
    }

    fn batch(&self) -> Batch {
        let Notes { shape, n_vocab, sequences, .. } = &self.notes;
        let texts = self.part("text.");
        let packed: Vec<Sequence> = sequences
            .iter()
            .zip(texts.values())
            .map(|(sequence, text)| {
                let &Supervised { ref codes, from, to } = sequence;
                Sequence { text: &text.values, codes, from, to }
            })
            .collect();
        Batch::pack(&packed, shape.d_text, end_token(*n_vocab))
    }
}

fn compare(variant: &str, kernels: Kernels, device: &Device) {
    let reference = read(variant);
    let (model, batch) = (reference.model(kernels, device), reference.batch());
    let logits = Source::of(model.logits(&batch)).on_host();
    let gradients = gradients(model.loss(&batch), &model.weights);
    reference.compare(&logits, &gradients, &format!("{variant}, {kernels:?}, {device:?}"));
}

/// The model's parameters after the reference's steps of AdamW.
fn stepped(reference: &Reference<Notes>) -> Weights {
    let Steps { steps, lr, betas, epsilon, weight_decay, clip_norm } = reference.notes.adamw;
    let [beta_1, beta_2] = betas;
    let clip_norm = Some(clip_norm);
    let config = AdamWConfig { beta_1, beta_2, epsilon, weight_decay, clip_norm };
    let mut model = reference.model(Kernels::Own, &Device::flex().autodiff());
    let (mut optimiser, batch) = (AdamW::new(config), reference.batch());
    for _ in 0..steps {
        let grads = GradientsParams::from_grads(model.loss(&batch).backward(), &model.weights);
        (model.weights, _) = optimiser.step(model.weights, grads, 1.0, lr);
    }
    weights::on_host(&weights::of_module(&model.weights))
}

/// How far the steps moved a parameter.
fn change(after: &HostTensor, before: &HostTensor) -> HostTensor {
    let values = after.values.iter().zip(&before.values).map(|(after, before)| after - before);
    HostTensor { shape: after.shape.clone(), values: values.collect() }
}

fn check_loss(variant: &str, kernels: Kernels) {
    let reference = read(variant);
    let (model, batch) = (reference.model(kernels, &Device::flex()), reference.batch());
    let expected = reference.notes.loss;
    let loss = f64::from(model.loss(&batch).into_scalar::<f32>());
    let nll = model.nll(&batch).nats;
    let mean = nll.iter().sum::<f64>() / nll.len() as f64;
    assert_eq!(nll.len(), 8 + 2 + 10);
    assert!((loss / expected - 1.0).abs() < TOLERANCE, "{loss} against {expected}");
    assert!((mean / expected - 1.0).abs() < TOLERANCE, "{mean} against {expected}");
}

#[test]
fn own_kernels_give_the_logits_and_gradients_of_the_equations() {
    for variant in VARIANTS {
        compare(variant, Kernels::Own, &Device::flex().autodiff());
    }
}

#[test]
fn plain_kernels_give_the_logits_and_gradients_of_the_equations() {
    for variant in VARIANTS {
        compare(variant, Kernels::Plain, &Device::flex().autodiff());
    }
}

#[test]
#[expect(deprecated, reason = "the one other backend that needs no GPU")]
fn another_backend_gives_the_logits_and_gradients_of_the_equations() {
    for variant in VARIANTS {
        compare(variant, Kernels::Plain, &Device::ndarray().autodiff());
    }
}

/// The change of a parameter is a tenth of it or less, and is rounded as the parameter is.
#[test]
fn adamw_moves_every_parameter_as_its_equations_say() {
    for variant in VARIANTS {
        let reference = read(variant);
        let (before, after) = (reference.part("param."), reference.part("after."));
        for (name, found) in stepped(&reference) {
            let expected = change(&after[&name], &before[&name]);
            let error = relative_error(&change(&found, &before[&name]), &expected);
            eprintln!("{variant}: the change of {name} is off by {error:.1e} of its norm");
            assert!(error < 10.0 * TOLERANCE, "{variant}, {name}: {error:.1e}");
        }
    }
}

#[test]
fn the_loss_is_the_mean_over_supervised_targets() {
    for variant in VARIANTS {
        check_loss(variant, Kernels::Own);
        check_loss(variant, Kernels::Plain);
    }
}
