//! [`TokenizerModule`]: encoder, quantizer and decoder as one trainable module; only this file matches on their
//! kinds.
//!
//! Shapes: b clips, t frames, f features, l latents of a clip, c latent channels, n latents of all clips.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::convolutional::{Decoder, Encoder};
use super::halves::{Captions, Decode, Encode, Pass, stands_for};
use super::patch::{PatchDecoder, PatchEncoder};
use super::pool::WindowPool;
use super::quantizer::{
    Extent, Fsq, Multiscale, Quantized, Quantizer, ResidualFsq, ResidualVq, Vq,
};
use super::transformer::{TransformerDecoder, TransformerEncoder};
use crate::data::FeatureStats;
use crate::draws::stream;
use crate::learn::weights::{self, Weights, WeightsError};
use crate::spec::{ArchitectureSpec, BegunFrom, CodebookSpec, Codes, QuantizerSpec, TokenizerSpec};

/// An encoder of any kind, as part of a module.
#[derive(Module, Debug)]
#[expect(clippy::large_enum_variant, reason = "a tokenizer holds one, and never many in a row")]
pub enum AnyEncoder {
    Convolutional(Encoder),
    Patch(PatchEncoder),
    Transformer(TransformerEncoder),
}

/// A decoder of any kind, as part of a module.
#[derive(Module, Debug)]
#[expect(clippy::large_enum_variant, reason = "a tokenizer holds one, and never many in a row")]
pub enum AnyDecoder {
    Convolutional(Decoder),
    Patch(PatchDecoder),
    Transformer(TransformerDecoder),
}

/// Has a half begin with fresh weights.
macro_rules! begins {
    ($any:ident, $part:ident: $($kind:ident $half:ident),*) => {
        impl $any {
            /// Fresh weights of an architecture, for frames of `n_features`.
            pub fn new(
                spec: &ArchitectureSpec,
                n_features: usize,
                rng: &mut ChaCha8Rng,
                device: &Device,
            ) -> Self {
                match spec {
                    $(ArchitectureSpec::$kind(sizes) => {
                        Self::$kind($half::new(sizes, n_features, rng, device))
                    })*
                }
            }
        }

        stands_for!($any, $part: $($kind),*);
    };
}

begins!(AnyEncoder, Encode: Convolutional Encoder, Patch PatchEncoder, Transformer TransformerEncoder);
begins!(AnyDecoder, Decode: Convolutional Decoder, Patch PatchDecoder, Transformer TransformerDecoder);

/// A quantizer of any kind, as part of a module.
#[derive(Module, Debug)]
pub enum AnyQuantizer {
    Fsq(Fsq),
    Vq(Vq),
    ResidualFsq(ResidualFsq),
    ResidualVq(ResidualVq),
    Multiscale(Multiscale),
}

impl AnyQuantizer {
    /// The quantizer of a tokenizer, for latents with `code_dim` channels.
    pub fn new(
        spec: &TokenizerSpec,
        code_dim: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let training = &spec.training;
        match &spec.quantizer {
            QuantizerSpec::Fsq { levels } => Self::Fsq(Fsq::new(levels, code_dim, rng, device)),
            QuantizerSpec::Vq { n_vocab } => {
                Self::Vq(Vq::new(*n_vocab, code_dim, training, rng, device))
            }
            QuantizerSpec::Residual(own) => match &own.codebook {
                CodebookSpec::Fsq { levels } => {
                    Self::ResidualFsq(ResidualFsq::new(own, levels, code_dim, rng, device))
                }
                CodebookSpec::Vq { n_vocab: n } => {
                    Self::ResidualVq(ResidualVq::new(own, *n, code_dim, training, rng, device))
                }
            },
            QuantizerSpec::Multiscale(own) => {
                Self::Multiscale(Multiscale::new(own, code_dim, training, rng, device))
            }
        }
    }
}

stands_for!(AnyQuantizer, Quantizer: Fsq, Vq, ResidualFsq, ResidualVq, Multiscale);

/// The stream of a seed from which weights are drawn.
const WEIGHTS_STREAM: u64 = 0;

/// Patches whose latents are made at a time.
const PATCHES_AT_ONCE: usize = 1 << 14;

/// The trained and saved module, on normalised features.
#[derive(Module, Debug)]
pub struct TokenizerModule {
    encoder: AnyEncoder,
    /// It may also learn outside the weights.
    pub quantizer: AnyQuantizer,
    decoder: AnyDecoder,
    /// Whether the decoder alone is trained.
    #[module(skip)]
    codes_are_fixed: bool,
}

impl TokenizerModule {
    /// Fresh weights from `rng`, for frames of `n_features`.
    pub fn new(
        spec: &TokenizerSpec,
        n_features: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let kind = &spec.architecture;
        Self {
            encoder: AnyEncoder::new(kind, n_features, rng, device),
            quantizer: AnyQuantizer::new(spec, kind.code_dim(), rng, device),
            decoder: AnyDecoder::new(kind, n_features, rng, device),
            codes_are_fixed: kind.codes() == Codes::Fixed,
        }
    }

    /// The module from weights, for features with these statistics.
    ///
    /// # Errors
    /// The weights do not fit this tokenizer.
    pub fn of_weights(
        spec: &TokenizerSpec,
        stats: &FeatureStats,
        saved: Weights,
        device: &Device,
    ) -> Result<Self, WeightsError> {
        let mut unused = ChaCha8Rng::seed_from_u64(0);
        let n_features = spec.representation.n_features(stats.mean.len());
        weights::into_module(Self::new(spec, n_features, &mut unused, device), saved)
    }

    /// Initial weights: random; or, if the architecture starts from data, from patches of the pool: encoder and decoder
    /// first, then the quantizer from their latents.
    pub fn begun(
        spec: &TokenizerSpec,
        pool: &WindowPool,
        n_features: usize,
        device: &Device,
    ) -> Self {
        let mut rng = stream(spec.training.seed, WEIGHTS_STREAM);
        let mut module = Self::new(spec, n_features, &mut rng, device);
        if let Some(BegunFrom { weights, codes }) = spec.begun_from() {
            let plain = device.clone().inner();
            let frames = spec.stride();
            let patches_np = rows(&Vec::from_iter(pool.patches(frames, weights)), &plain);
            module.encoder.begin(&patches_np);
            let latents_nc = module.latents(patches_np.clone(), n_features);
            module.decoder.begin(&latents_nc, &patches_np);
            let of_codes = Vec::from_iter(pool.patches(frames, codes));
            let latents_of = |part: &[_]| module.latents(rows(part, &plain), n_features);
            let latents = of_codes.chunks(PATCHES_AT_ONCE).map(latents_of).collect();
            module.quantizer.begin(&Tensor::cat(latents, 0));
        }
        module
    }

    /// The latent of each patch, `[n, c]`, without gradient.
    fn latents(&self, patches_np: Tensor<2>, n_features: usize) -> Tensor<2> {
        let [n, p] = patches_np.dims();
        let clips_btf = patches_np.reshape([n, p / n_features, n_features]);
        let latents_btc = self.encoder.valid().forward(clips_btf, &mut Pass::default());
        let [_, _, c] = latents_btc.dims();
        latents_btc.reshape([n, c])
    }

    /// A training pass: normalised features, `[b, t, f]`, and the quantizer's own term of the loss, `[1]`.
    /// Gradients pass through, and the quantizer updates its state on the host.
    pub fn reconstruct(
        &mut self,
        x_btf: Tensor<3>,
        pass: &mut Pass,
    ) -> (Tensor<3>, Option<Tensor<1>>) {
        let n_frames = x_btf.dims()[1];
        let latents_btc = self.encoder.forward(x_btf, pass);
        let Quantized { quantized_btc, auxiliary_loss } = if self.codes_are_fixed {
            self.quantize_fixed(latents_btc.detach())
        } else {
            self.quantizer.quantize(latents_btc)
        };
        (self.decoder.forward(quantized_btc, n_frames, pass), auxiliary_loss)
    }

    /// Embeddings of the codes of latents, without gradient; no code moves.
    fn quantize_fixed(&self, latents_btc: Tensor<3>) -> Quantized {
        let [n_clips, n_latents, _] = latents_btc.dims();
        let ids = self.quantizer.ids(latents_btc);
        let quantized_btc = self.quantizer.embed(&ids, Extent { n_clips, n_latents });
        Quantized { quantized_btc, auxiliary_loss: None }
    }

    /// Codes of `[b, t, f]`, clip after clip.
    pub fn ids(&self, x_btf: Tensor<3>, captions: Option<&Captions>) -> Vec<u32> {
        self.quantizer.ids(self.encoder.forward(x_btf, &mut Pass::reading(captions)))
    }

    /// Features `[b, t, f]` of quantized latents `[b, l, c]`, those of clips of `n_frames` frames.
    ///
    /// With language-free guidance g other than 0 these are (1 + g) m_c − g m_u, with m_c decoded with captions and m_u
    /// without (LG-Tok).
    pub fn decode(
        &self,
        latents_blc: Tensor<3>,
        n_frames: usize,
        captions: Option<&Captions>,
        guidance: f64,
    ) -> Tensor<3> {
        let none = Captions::none(latents_blc.dims()[0]);
        let made = |captions| {
            self.decoder.forward(latents_blc.clone(), n_frames, &mut Pass::reading(captions))
        };
        if captions.is_none() || guidance == 0.0 {
            return made(captions);
        }
        let without = made(Some(&none));
        made(captions) * (1.0 + guidance) - without * guidance
    }
}

/// `[n, p]` of n patches of p values.
fn rows(patches: &[&[f32]], device: &Device) -> Tensor<2> {
    let shape = [patches.len(), patches[0].len()];
    Tensor::from_data(TensorData::new(patches.concat(), shape), device)
}
