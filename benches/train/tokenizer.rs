//! Shapes of the transformer tokenizer: both halves, without the quantizer between them.

use burn::module::Module;
use burn::optim::GradientsParams;
use burn::tensor::{Device, Tensor};
use isoflop::ops::Kernels;
use isoflop::spec::{ArchitectureSpec, LanguagePlace, LanguageSpec, TransformerSpec};
use isoflop::tokenizer::{AnyDecoder, AnyEncoder, Captions, Pass};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::{Case, Stepper, optimiser};

/// Features of a frame, and those that the encoder sees.
const FEATURES: usize = 263;
const SEEN: usize = 67;

/// Words of a caption, and the width of their vectors.
const WORDS: usize = 12;
const D_TEXT: usize = 64;

/// One shape to time, with language at both halves.
pub struct TokenizerCase {
    name: &'static str,
    width: usize,
    layers: usize,
    latent: usize,
    frames: usize,
    clips: usize,
}

/// A small one, a middle one, and LG-Tok's.
pub fn cases() -> [TokenizerCase; 3] {
    let case = |name, [width, layers, latent, frames, clips]: [usize; 5]| TokenizerCase {
        name,
        width,
        layers,
        latent,
        frames,
        clips,
    };
    [
        case("tokenizer-nano", [64, 3, 32, 100, 16]),
        case("tokenizer-mid", [128, 5, 128, 144, 8]),
        case("tokenizer-lg-tok", [256, 9, 512, 196, 2]),
    ]
}

/// What is trained.
#[derive(Module, Debug)]
struct Halves {
    encoder: AnyEncoder,
    decoder: AnyDecoder,
}

impl Halves {
    /// Mean squared error of the features, `[1]`.
    fn loss(&self, x_btf: Tensor<3>, captions: &Captions) -> Tensor<1> {
        let mut pass = Pass::reading(Some(captions));
        let latents_btc = self.encoder.forward(x_btf.clone(), &mut pass);
        let n_frames = x_btf.dims()[1];
        let off = self.decoder.forward(latents_btc, n_frames, &mut pass) - x_btf;
        (off.clone() * off).mean()
    }
}

impl TokenizerCase {
    fn spec(&self) -> ArchitectureSpec {
        let language = LanguageSpec {
            at: vec![LanguagePlace::Tokenizer, LanguagePlace::Detokenizer],
            drop: 0.1,
            dim: D_TEXT,
            max_tokens: WORDS,
        };
        let &Self { width, layers, latent, frames: span, .. } = self;
        ArchitectureSpec::Transformer(TransformerSpec {
            width,
            layers,
            latent,
            span,
            language: Some(language),
            ..TransformerSpec::default()
        })
    }

    /// Multiply-adds of a clip's forward pass.
    fn multiply_adds(&self) -> usize {
        let (f, d, c) = (self.frames, self.width, self.latent);
        let t = f / 4;
        let layer = |rows: usize| rows * (4 + 12) * d * d + 2 * rows * rows * d;
        let cross = |rows: usize| 2 * f * d * d + 2 * rows * d * d + 2 * f * rows * d;
        let joins = |rows: usize| self.layers / 2 * rows * 2 * d * d;
        let rows = t + f + WORDS;
        let encoder = self.layers * layer(rows) + joins(rows) + f * SEEN * d + 3 * t * d * c;
        let decoder = self.layers * (layer(f) + cross(t) + cross(WORDS)) + joins(f);
        let words = 2 * WORDS * D_TEXT * d;
        encoder + decoder + words + f * FEATURES * d + 3 * t * d * c
    }
}

impl Case for TokenizerCase {
    fn name(&self) -> &'static str {
        self.name
    }

    /// The model takes the kernels of its device.
    fn kernels(&self) -> &[Kernels] {
        &[Kernels::Own]
    }

    /// Frames.
    fn tokens(&self) -> usize {
        self.clips * self.frames
    }

    fn flops(&self) -> f64 {
        6.0 * (self.clips * self.multiply_adds()) as f64
    }

    fn stepper(&self, _: Kernels) -> Stepper {
        let (spec, device) = (self.spec(), Device::flex().autodiff());
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let encoder = AnyEncoder::new(&spec, FEATURES, &mut rng, &device);
        let decoder = AnyDecoder::new(&spec, FEATURES, &mut rng, &device);
        let mut halves = Halves { encoder, decoder };
        let caption = vec![0.5; WORDS * D_TEXT];
        let captions = Captions::of(vec![&caption[..]; self.clips], D_TEXT);
        let shape = [self.clips, self.frames, FEATURES];
        let n = shape.iter().product::<usize>() as i64;
        let wave = Tensor::<1, burn::tensor::Int>::arange(0..n, &device).float() * 0.01;
        let (x_btf, mut optimiser) = (wave.sin().reshape(shape), optimiser());
        Box::new(move || {
            let loss = halves.loss(x_btf.clone(), &captions);
            let value = loss.clone().into_scalar::<f32>();
            let gradients = GradientsParams::from_grads(loss.backward(), &halves);
            halves = optimiser.step(halves.clone(), gradients, 1.0, 1e-3).0;
            value
        })
    }
}
