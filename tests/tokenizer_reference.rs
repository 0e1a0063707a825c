//! Latents and frames of the transformer tokenizer, against an implementation in JAX and float64.
//!
//! `fixtures/transformer-tokenizer/make.py` writes the numbers. It pads each clip and masks densely
//! where the library packs. Parameters are exact in `f32`; what is left is the library's rounding.

#[path = "support/reference.rs"]
#[expect(dead_code, reason = "gradients are not compared here")]
mod reference;

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::Deserialize;

use isoflop::learn::weights::{self, HostTensor, Source, Weights};
use isoflop::spec::{ArchitectureSpec, TransformerSpec};
use isoflop::tokenizer::{AnyDecoder, AnyEncoder, Captions, Pass};
use reference::{Reference, TOLERANCE, relative_error};

/// Norm, positions, detokenizer, the halves that see captions, and where it is so the fixed number of latents, or GELU
/// without skips.
const VARIANTS: [&str; 8] = [
    "post-learned-cross-tokenizer-detokenizer",
    "pre-learned-cross-none",
    "pre-rotary-context-tokenizer-detokenizer",
    "post-rotary-cross-detokenizer",
    "post-learned-context-tokenizer",
    "post-learned-cross-tokenizer-5-latents",
    "pre-rotary-cross-detokenizer-5-latents",
    "layer-rotary-cross-tokenizer-gelu-unskipped",
];

/// What stands in a file of reference values beside its tensors.
#[derive(Deserialize)]
struct Notes {
    sizes: TransformerSpec,
    words: Vec<usize>,
}

impl Reference<Notes> {
    /// A half with the reference's parameters, which must be all that it has.
    fn half<M: Module>(&self, name: &str, drawn: M) -> M {
        let named = self.tensors.iter().filter_map(|(path, tensor)| {
            let path = path.strip_prefix(name)?.strip_prefix('.')?;
            Some((format!("Transformer.{path}"), tensor.clone()))
        });
        let parameters: Weights = named.collect();
        let own = weights::of_module(&drawn);
        assert!(own.keys().eq(parameters.keys()), "{:?}", own.keys());
        weights::into_module(drawn, parameters).expect("the same shapes")
    }

    fn tensor(&self, name: &str, device: &Device) -> Tensor<3> {
        let HostTensor { shape, values } = &self.tensors[name];
        let shape: [usize; 3] = shape.as_slice().try_into().expect("clips");
        Tensor::from_data(TensorData::new(values.clone(), shape), device)
    }

    fn captions(&self) -> Captions {
        let HostTensor { shape, values } = &self.tensors["captions"];
        let dim = shape[1];
        let mut words = values.chunks(dim);
        let mut caption = |n: &usize| words.by_ref().take(*n).flatten().copied().collect();
        let captions: Vec<Vec<f32>> = self.notes.words.iter().map(&mut caption).collect();
        Captions::of(captions.iter().map(Vec::as_slice), dim)
    }
}

fn compare(variant: &str, device: &Device) {
    let reference = Reference::<Notes>::read("transformer-tokenizer", variant);
    let spec = ArchitectureSpec::Transformer(reference.notes.sizes.clone());
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let encoder = reference.half("encoder", AnyEncoder::new(&spec, 70, &mut rng, device));
    let decoder = reference.half("decoder", AnyDecoder::new(&spec, 70, &mut rng, device));
    let captions = reference.captions();
    let mut pass = Pass::reading(Some(&captions));
    let clips = reference.tensor("clips", device);
    let n_frames = clips.dims()[1];
    let latents = encoder.forward(clips, &mut pass);
    let frames = decoder.forward(reference.tensor("latents", device), n_frames, &mut pass);
    for (found, expected) in [(latents, "encoded"), (frames, "decoded")] {
        let error = relative_error(&Source::of(found).on_host(), &reference.tensors[expected]);
        eprintln!("{variant}, {device:?}: {expected} is off by {error:.1e} of its norm");
        assert!(error < TOLERANCE, "{variant}, {device:?}: {expected} is off by {error:.1e}");
    }
}

#[test]
fn latents_and_frames_are_those_of_the_equations() {
    for variant in VARIANTS {
        compare(variant, &Device::flex());
        compare(variant, &Device::flex().autodiff());
    }
}

#[test]
#[expect(deprecated, reason = "the one other backend that needs no GPU")]
fn another_backend_gives_the_latents_and_frames_of_the_equations() {
    for variant in VARIANTS {
        compare(variant, &Device::ndarray());
    }
}
