//! The quantizers of several scales against an implementation in JAX and float64: codes, the sum after
//! each scale, the loss, its gradients, and the codebooks after a step.
//!
//! `fixtures/quantizers/make.py` writes the numbers, a clip and a latent at a time. Latents and weights
//! are exact in `f32`.

#[path = "support/reference.rs"]
#[expect(dead_code, reason = "its file alone is wanted")]
mod reference;

use burn::module::{Module, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::Deserialize;
use serde_json::json;

use isoflop::learn::LoadedState;
use isoflop::learn::weights::{self, HostTensor, Source, Weights};
use isoflop::spec::{CodebookSpec, MultiscaleSpec, ResidualSpec, TokenizerTraining};
use isoflop::tokenizer::{AnyQuantizer, Extent, Multiscale, Quantized, ResidualVq};
use reference::Reference;

/// Largest difference of a value.
const TOLERANCE: f32 = 1e-5;

const MULTISCALE: [&str; 3] = ["multiscale-cosine", "multiscale-euclid", "multiscale-mix"];
const RESIDUAL: &str = "residual";

#[derive(Deserialize)]
struct Notes {
    ids: Vec<u32>,
    loss: f32,
    scales: Vec<usize>,
    cosine: bool,
    mix: Option<f64>,
    commitment: f64,
    beta: f64,
    count: f32,
    last_count: f32,
}

fn read(name: &str) -> Reference<Notes> {
    Reference::read("quantizers", name)
}

impl Reference<Notes> {
    fn codebooks(&self) -> Vec<&HostTensor> {
        (0..).map_while(|n| self.tensors.get(&format!("codes.{n}"))).collect()
    }

    fn latents(&self, device: &Device) -> Tensor<3> {
        let HostTensor { shape, values } = &self.tensors["latents"];
        Tensor::from_data(TensorData::new(values.clone(), shape.clone()), device)
    }

    fn extent(&self) -> Extent {
        let shape = &self.tensors["latents"].shape;
        Extent { n_clips: shape[0], n_latents: shape[1] }
    }

    /// The quantizer with the reference's weights, its codebooks placed.
    fn quantizer(&self, device: &Device) -> AnyQuantizer {
        let drawn = self.drawn(device);
        let mut named = weights::on_host(&weights::of_module(&drawn));
        for (name, value) in &mut named {
            *value = self.weight(name).clone();
        }
        let mut quantizer = weights::into_module(drawn, named).expect("the same shapes");
        quantizer.resume(self.state()).expect("the state of such a quantizer");
        quantizer
    }

    fn drawn(&self, device: &Device) -> AnyQuantizer {
        let Notes { scales, cosine, mix, commitment, beta, .. } = &self.notes;
        let sizes = self.codebooks().into_iter().map(|codes| codes.shape[0]);
        let codebooks: Vec<CodebookSpec> =
            sizes.map(|n_vocab| CodebookSpec::Vq { n_vocab }).collect();
        let training = TokenizerTraining { commitment: *commitment, ..Default::default() };
        let (code_dim, mut rng) = (self.tensors["latents"].shape[2], ChaCha8Rng::seed_from_u64(0));
        if scales.is_empty() {
            let (codebook, layers) = (codebooks[0].clone(), codebooks.len());
            let n_vocab = codebook.n_vocab();
            let spec = ResidualSpec { layers, codebook, dropout: 0.0 };
            let own = ResidualVq::new(&spec, n_vocab, code_dim, &training, &mut rng, device);
            return AnyQuantizer::ResidualVq(own);
        }
        let (scales, cosine, beta, mix) = (scales.clone(), *cosine, *beta, *mix);
        let spec = MultiscaleSpec { scales, codebooks, cosine, beta, mix };
        AnyQuantizer::Multiscale(Multiscale::new(&spec, code_dim, &training, &mut rng, device))
    }

    /// The weight of a parameter's name: `codebooks.1.codebook`, `layers.0.codebook` or one of φ.
    fn weight(&self, name: &str) -> &HostTensor {
        let parts: Vec<&str> = name.split('.').collect();
        let at = parts.iter().position(|part| ["codebooks", "layers"].contains(part));
        let own = match at {
            Some(at) => format!("codes.{}", parts[at + 1]),
            None => format!("param.{}", suffix(name)),
        };
        self.tensors.get(&own).unwrap_or_else(|| panic!("{name} is no weight of the reference"))
    }

    /// The state in which every code has been met as often as the reference says.
    fn state(&self) -> LoadedState {
        let Notes { count, last_count, .. } = self.notes;
        let mut tensors = Weights::new();
        let codebooks = self.codebooks();
        for (n, codes) in codebooks.iter().enumerate() {
            let [v, c] = codes.shape[..] else { panic!("codes are rows") };
            let counts: Vec<f32> =
                (0..v).map(|i| if i + 1 == v { last_count } else { count }).collect();
            let sums = codes.values.iter().enumerate().map(|(i, x)| x * counts[i / c]).collect();
            tensors.insert(format!("{n}.sums"), HostTensor { shape: vec![v * c], values: sums });
            tensors.insert(format!("{n}.counts"), HostTensor { shape: vec![v], values: counts });
        }
        let parts = vec![json!({ "drawn": "0" }); codebooks.len()];
        LoadedState { note: json!({ "parts": parts, "own": "0" }), tensors }
    }
}

/// A name from `smoothings` on.
fn suffix(name: &str) -> &str {
    &name[name.find("smoothings").unwrap_or(0)..]
}

fn host<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().try_into_vec().expect("f32")
}

fn assert_near(what: &str, found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let worst = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    eprintln!("{what} is off by {worst:.1e}");
    assert!(worst < TOLERANCE, "{what} is off by {worst:.1e}");
}

/// Values under the names of their parameters.
struct Named<'a> {
    path: Vec<String>,
    grads: Option<&'a GradientsParams>,
    found: Weights,
}

impl ModuleVisitor for Named<'_> {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let value = match self.grads {
            Some(grads) => grads.get::<D>(param.id),
            None => Some(param.val()),
        };
        let name = self.path.join(".");
        self.found.extend(value.map(|value| (name, Source::of(value).on_host())));
    }
}

fn named(quantizer: &AnyQuantizer, grads: Option<&GradientsParams>) -> Weights {
    let mut visitor = Named { path: Vec::new(), grads, found: Weights::new() };
    quantizer.visit(&mut visitor);
    visitor.found
}

fn all() -> impl Iterator<Item = &'static str> {
    MULTISCALE.into_iter().chain([RESIDUAL])
}

#[test]
fn codes_and_sums_are_those_of_the_equations() {
    for name in all() {
        let reference = read(name);
        let device = Device::flex();
        let quantizer = reference.quantizer(&device);
        let ids = quantizer.ids(reference.latents(&device));
        assert_eq!(ids, reference.notes.ids, "{name}");
        let sums = quantizer.sums(&ids, reference.extent());
        assert_eq!(sums.len(), reference.codebooks().len());
        for (n, sum) in sums.into_iter().enumerate() {
            let expected = &reference.tensors[&format!("sum.{n}")].values;
            assert_near(&format!("{name}, sum {n}"), &host(sum), expected);
        }
    }
}

#[test]
fn the_loss_and_its_gradients_are_those_of_the_equations() {
    for name in all() {
        let reference = read(name);
        let device = Device::flex().autodiff();
        let mut quantizer = reference.quantizer(&device);
        let latents_btc = reference.latents(&device).require_grad();
        let Quantized { quantized_btc, auxiliary_loss } = quantizer.quantize(latents_btc.clone());
        let last = format!("sum.{}", reference.codebooks().len() - 1);
        let seen = host(quantized_btc.inner());
        assert_near(&format!("{name}, seen"), &seen, &reference.tensors[&last].values);
        let loss = auxiliary_loss.expect("learned codes have a loss");
        assert_near(&format!("{name}, loss"), &host(loss.clone()), &[reference.notes.loss]);
        let grads = loss.backward();
        let to_latents = host(latents_btc.grad(&grads).expect("a gradient"));
        let expected = &reference.tensors["grad.latents"].values;
        assert_near(&format!("{name}, latents"), &to_latents, expected);
        let grads = GradientsParams::from_grads(grads, &quantizer);
        let found = named(&quantizer, Some(&grads));
        let expected = reference.tensors.keys().filter(|key| key.starts_with("grad.smoothings"));
        assert_eq!(found.len(), expected.count(), "{name}");
        for (parameter, grad) in found {
            let expected = &reference.tensors[&format!("grad.{}", suffix(&parameter))];
            assert_near(&format!("{name}, {parameter}"), &grad.values, &expected.values);
        }
    }
}

#[test]
fn codebooks_move_as_the_equations_say() {
    for name in all() {
        let reference = read(name);
        let device = Device::flex().autodiff();
        let mut quantizer = reference.quantizer(&device);
        quantizer.quantize(reference.latents(&device));
        let codebooks = named(&quantizer.valid(), None);
        let codebooks = codebooks.iter().filter(|(name, _)| name.ends_with("codebook"));
        let mut n_codebooks = 0;
        for (n, (parameter, codes)) in codebooks.enumerate() {
            let expected = &reference.tensors[&format!("after.{n}")];
            assert_near(&format!("{name}, {parameter}"), &codes.values, &expected.values);
            n_codebooks += 1;
        }
        assert_eq!(n_codebooks, reference.codebooks().len());
    }
}
