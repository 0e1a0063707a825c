//! Logits, loss and gradients of the scale-by-scale and the masked transformer, and the codes that
//! rounds of unmasking leave, against implementations in JAX and float64.
//!
//! `fixtures/generators/make.py` writes the numbers. It takes one clip at a time and masks densely where
//! the library packs clips and works by blocks. Parameters are exact in `f32`; what is left is the
//! library's rounding.

use std::path::PathBuf;

use burn::module::{Module, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::Deserialize;
use serde::de::DeserializeOwned;

use isoflop::codes::{Grid, Length, Scale};
use isoflop::generator::masked::{Hidden, pack};
use isoflop::generator::{self, Draw, Prompt, Sampling, ScaleInputs};
use isoflop::generator::{autoregressive, scalewise};
use isoflop::learn::weights::{self, HostTensor, Source, Weights};
use isoflop::ops::Kernels;
use isoflop::plan::RunSpec;
use isoflop::spec::{GeneratorSpec, MaskedSpec, ModelShape, Precision, ScalewiseSpec};

#[path = "support/corpus.rs"]
#[expect(dead_code, reason = "its small run alone is wanted")]
mod corpus;

/// Largest difference of two tensors, as a share of the reference's norm.
const TOLERANCE: f64 = 1e-5;

struct Reference<N> {
    notes: N,
    tensors: Weights,
}

#[derive(Deserialize)]
struct ScalewiseNotes {
    shape: ModelShape,
    scales: Vec<(usize, usize)>,
    d_latent: usize,
    most_latents: usize,
    clips: Vec<ScalewiseClip>,
    loss: f64,
}

#[derive(Deserialize)]
struct ScalewiseClip {
    codes: Vec<u32>,
    n_latents: usize,
    from: usize,
    to: usize,
}

#[derive(Deserialize)]
struct MaskedNotes {
    shape: ModelShape,
    n_vocab: usize,
    clips: Vec<HiddenClip>,
    made: Vec<Made>,
    loss: f64,
}

#[derive(Deserialize)]
struct HiddenClip {
    codes: Vec<u32>,
    hidden: Vec<usize>,
}

/// The codes of motions of the likeliest codes, by so many rounds.
#[derive(Deserialize)]
struct Made {
    rounds: usize,
    guidance: f64,
    codes: Vec<Vec<u32>>,
}

impl<N: DeserializeOwned> Reference<N> {
    fn read(name: &str) -> Self {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/generators");
        let path = PathBuf::from(folder).join(format!("{name}.safetensors"));
        let (tensors, notes) = weights::load(&path).expect("make.py wrote it");
        let notes = serde_json::from_str(&notes["reference"]).expect("make.py wrote them");
        Self { notes, tensors }
    }

    /// The tensors whose names start with `prefix`, without it.
    fn part(&self, prefix: &str) -> Weights {
        let named = self.tensors.iter().filter_map(|(name, tensor)| {
            Some((name.strip_prefix(prefix)?.to_owned(), tensor.clone()))
        });
        named.collect()
    }

    /// A drawn module with the reference's parameters, which must be all that it has.
    fn parameters<M: Module>(&self, drawn: M) -> M {
        let parameters = self.part("param.");
        assert!(weights::of_module(&drawn).keys().eq(parameters.keys()), "names differ");
        weights::into_module(drawn, parameters).expect("the same shapes")
    }

    /// The largest relative error over the logits and every gradient, which must be small.
    fn compare(&self, logits: HostTensor, gradients: &Weights, about: &str) {
        let expected = self.part("grad.");
        assert!(gradients.keys().eq(expected.keys()), "{:?}", gradients.keys());
        let mut errors = vec![("logits", relative_error(&logits, &self.tensors["logits"]))];
        errors.extend(gradients.iter().map(|(n, g)| (n.as_str(), relative_error(g, &expected[n]))));
        let (name, worst) = errors.iter().max_by(|a, b| a.1.total_cmp(&b.1)).expect("not empty");
        eprintln!("{about}: {name} is off by {worst:.1e} of its norm");
        assert!(*worst < TOLERANCE, "{about}: {name} is off by {worst:.1e}");
    }
}

/// |found − expected| / |expected|, with L2 norms over all elements.
fn relative_error(found: &HostTensor, expected: &HostTensor) -> f64 {
    assert_eq!(found.values.len(), expected.values.len());
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
    let pairs = found.values.iter().zip(&expected.values);
    let difference = norm(&mut pairs.map(|(f, e)| f64::from(*f) - f64::from(*e)));
    difference / norm(&mut expected.values.iter().map(|e| f64::from(*e)))
}

/// Gradients under the names of their parameters.
struct Gradients<'a> {
    path: Vec<String>,
    grads: &'a GradientsParams,
    named: Weights,
}

impl ModuleVisitor for Gradients<'_> {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let name = self.path.join(".");
        let grad = self.grads.get::<D>(param.id);
        let grad = grad.unwrap_or_else(|| panic!("{name} has no gradient"));
        self.named.insert(name, Source::of(grad).on_host());
    }
}

fn gradients<M: Module>(loss: Tensor<1>, module: &M) -> Weights {
    let grads = GradientsParams::from_grads(loss.backward(), module);
    let mut visitor = Gradients { path: Vec::new(), grads: &grads, named: Weights::new() };
    module.visit(&mut visitor);
    visitor.named
}

fn close(found: f64, expected: f64) {
    assert!((found / expected - 1.0).abs() < TOLERANCE, "{found} against {expected}");
}

/// The values of matrices after one another.
fn concat(rows: impl IntoIterator<Item = Tensor<2>>) -> HostTensor {
    let values: Vec<f32> = rows.into_iter().flat_map(|x| Source::of(x).on_host().values).collect();
    HostTensor { shape: vec![values.len()], values }
}

/// The scale-by-scale model of the reference, and its batch.
fn scalewise_of(
    reference: &Reference<ScalewiseNotes>,
    device: &Device,
) -> (scalewise::Model, scalewise::Batch) {
    let ScalewiseNotes { shape, scales, d_latent, most_latents, clips, .. } = &reference.notes;
    let scale = |&(n_vocab, n): &(usize, usize)| Scale { n_vocab, length: Length::Codes(n) };
    let grid = Grid { scales: scales.iter().map(scale).collect(), end_token: false };
    let spec = ScalewiseSpec {
        shape: shape.clone(),
        d_latent: *d_latent,
        frames_per_latent: 4,
        most_latents: *most_latents,
        corruption: 0.5,
        text_drop: 0.1,
    };
    let mut unused = ChaCha8Rng::seed_from_u64(0);
    let mut model = scalewise::Model::init(&spec, &grid, Precision::F32, &mut unused, device);
    model.weights = reference.parameters(model.weights);
    let texts = reference.part("text.");
    let packed = clips.iter().enumerate().map(|(i, clip)| scalewise::Clip {
        text: &texts[&i.to_string()].values,
        codes: &clip.codes,
        lengths: scales.iter().map(|(_, n)| *n).collect(),
        inputs: reference.part(&format!("inputs.{i}.")).into_values().map(|x| x.values).collect(),
        n_latents: clip.n_latents,
        supervised: clip.from..clip.to,
    });
    let clips: Vec<scalewise::Clip> = packed.collect();
    let batch = scalewise::Batch::pack(&clips, &grid, shape.d_text, model.places());
    (model, batch)
}

/// Logits of the supervised codes in the reference's order: clip after clip.
fn scalewise_logits(reference: &Reference<ScalewiseNotes>, device: &Device) -> HostTensor {
    let (model, batch) = scalewise_of(reference, device);
    let features = model.features(&batch);
    let rows = batch.targets.iter().enumerate().flat_map(|(scale, own)| {
        own.rows.iter().map(move |&row| (row as usize, scale)).collect::<Vec<_>>()
    });
    let mut rows: Vec<(usize, usize)> = rows.collect();
    rows.sort_unstable();
    let logits =
        |(row, scale): (usize, usize)| model.logits(scale, features.clone().slice([row..row + 1]));
    concat(rows.into_iter().map(logits))
}

fn compare_scalewise(device: &Device) {
    let reference = Reference::read("scalewise");
    let (model, batch) = scalewise_of(&reference, &device.clone().autodiff());
    let loss = model.loss(&batch);
    close(f64::from(loss.clone().into_scalar::<f32>()), reference.notes.loss);
    let gradients = gradients(loss, &model.weights);
    reference.compare(scalewise_logits(&reference, device), &gradients, &format!("{device:?}"));
}

#[test]
fn scale_by_scale_logits_and_gradients_are_those_of_the_equations() {
    compare_scalewise(&Device::flex());
}

#[test]
#[expect(deprecated, reason = "the one other backend that needs no GPU")]
fn another_backend_gives_scale_by_scale_the_logits_and_gradients_of_the_equations() {
    compare_scalewise(&Device::ndarray());
}

#[test]
fn scale_by_scale_the_likelihood_of_each_code_is_that_of_the_loss() {
    let reference = Reference::read("scalewise");
    let (model, batch) = scalewise_of(&reference, &Device::flex());
    let nll: Vec<f64> = model.nll(&batch).concat();
    let supervised = reference.notes.clips.iter().map(|clip| clip.to - clip.from);
    assert_eq!(nll.len(), supervised.sum::<usize>());
    close(nll.iter().sum::<f64>() / nll.len() as f64, reference.notes.loss);
}

/// The masked model of the reference.
fn masked_of(
    reference: &Reference<MaskedNotes>,
    kernels: Kernels,
    device: &Device,
) -> autoregressive::Model {
    let MaskedNotes { shape, n_vocab, .. } = &reference.notes;
    let mut unused = ChaCha8Rng::seed_from_u64(0);
    let drawn = autoregressive::Transformer::init(shape, *n_vocab, &mut unused, device);
    autoregressive::Model::new(reference.parameters(drawn), shape, *n_vocab, kernels, device)
}

fn compare_masked(kernels: Kernels, device: &Device) {
    let reference: Reference<MaskedNotes> = Reference::read("masked");
    let MaskedNotes { shape, n_vocab, clips, loss: expected, .. } = &reference.notes;
    let texts = reference.part("text.");
    let hide = |(clip, text): (&HiddenClip, &'_ HostTensor)| {
        let shown = clip.codes.iter().enumerate();
        let is_hidden = |place| clip.hidden.contains(&place);
        let end = *n_vocab as u32;
        let shown = shown.map(|(place, &code)| if is_hidden(place) { end } else { code });
        let targets = clip.hidden.iter().map(|&place| (place, clip.codes[place]));
        (text.values.clone(), shown.collect::<Vec<_>>(), targets.collect::<Vec<_>>())
    };
    let parts: Vec<_> = clips.iter().zip(texts.values()).map(hide).collect();
    let clips = parts.iter().map(|(text, shown, targets)| Hidden {
        text,
        shown: shown.clone(),
        targets: targets.clone(),
    });
    let batch = pack(&clips.collect::<Vec<_>>(), shape.d_text);
    let model = masked_of(&reference, kernels, &device.clone().autodiff());
    let loss = model.loss(&batch);
    close(f64::from(loss.clone().into_scalar::<f32>()), *expected);
    let gradients = gradients(loss, &model.weights);
    let logits = concat([model.logits(&batch)]);
    reference.compare(logits, &gradients, &format!("{kernels:?}, {device:?}"));
}

#[test]
fn masked_logits_and_gradients_are_those_of_the_equations() {
    compare_masked(Kernels::Own, &Device::flex());
    compare_masked(Kernels::Plain, &Device::flex());
}

#[test]
#[expect(deprecated, reason = "the one other backend that needs no GPU")]
fn another_backend_gives_the_masked_logits_and_gradients_of_the_equations() {
    compare_masked(Kernels::Plain, &Device::ndarray());
}

/// A tokenizer that no masked model asks.
struct Nobody;

impl ScaleInputs for Nobody {
    fn inputs(&self, _: &[u32], _: usize, _: usize) -> Vec<Vec<f32>> {
        unreachable!("codes have one scale")
    }

    fn n_latents(&self, _: usize) -> usize {
        unreachable!("codes have one scale")
    }
}

/// The rounds of the masked model: which codes are hidden again, and what stays.
#[test]
fn rounds_leave_the_codes_that_momasks_schedule_leaves() {
    let reference: Reference<MaskedNotes> = Reference::read("masked");
    let MaskedNotes { shape, n_vocab, made, .. } = &reference.notes;
    let mut spec: RunSpec = corpus::small_run(*n_vocab);
    let own = MaskedSpec { shape: shape.clone(), corruption: 0.0, text_drop: 0.1 };
    spec.generator = GeneratorSpec::Masked(own);
    let sampler = generator::of(&spec).sampler(&spec, reference.part("param."), &Device::flex());
    let (sampler, texts) = (sampler.unwrap(), reference.part("prompt."));
    for Made { rounds, guidance, codes } in made {
        let prompts = codes.iter().zip(texts.values()).map(|(codes, text)| Prompt {
            text: &text.values,
            n_frames: Some(4 * codes.len()),
            seed: 0,
            index: 0,
            edit: None,
        });
        let prompts: Vec<Prompt> = prompts.collect();
        let draw = Draw { temperature: 0.0, ..Draw::default() };
        let sampling = Sampling { draw, guidance: *guidance, rounds: *rounds };
        let sampled = sampler.sample(&prompts, &Nobody, &sampling).unwrap();
        let found: Vec<Vec<u32>> = sampled.into_iter().map(|one| one.codes).collect();
        assert_eq!(&found, codes, "{rounds} rounds, guidance {guidance}");
    }
}
