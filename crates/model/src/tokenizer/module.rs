//! [`TokenizerModule`]: encoder, quantizer and decoder as one trainable module.
//!
//! Shapes: b clips, t frames, f features, c latent channels, n = b·t/s latents.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::architecture::{AnyDecoder, AnyEncoder};
use super::captions::Captions;
use super::pass::Pass;
use super::quantizer::{self, AnyQuantizer, Extent, Quantized, Quantizer};
use crate::data::FeatureStats;
use crate::learn::weights::{self, Weights, WeightsError};
use crate::spec::{Codes, TokenizerSpec};

/// What is trained and saved; it works on normalised features.
#[derive(Module, Debug)]
pub struct TokenizerModule {
    encoder: AnyEncoder,
    quantizer: AnyQuantizer,
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
            quantizer: quantizer::init(spec, kind.code_dim(), rng, device),
            decoder: AnyDecoder::new(kind, n_features, rng, device),
            codes_are_fixed: kind.codes() == Codes::Fixed,
        }
    }

    /// The module of weights, for features with these statistics.
    ///
    /// # Errors
    /// The weights are not those of such a tokenizer.
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

    /// Begins the encoder and the decoder from patches of training clips, `[n, s·f]`.
    pub fn begin_weights(&mut self, patches_np: &Tensor<2>, n_features: usize) {
        self.encoder.begin(patches_np);
        let latents_nc = self.latents(patches_np.clone(), n_features);
        self.decoder.begin(&latents_nc, patches_np);
    }

    /// Begins the quantizer from latents, `[n, c]`.
    pub fn begin_codes(&mut self, latents_nc: &Tensor<2>) {
        self.quantizer.begin(latents_nc);
    }

    /// The latent of each patch, `[n, c]`, without gradient.
    pub fn latents(&self, patches_np: Tensor<2>, n_features: usize) -> Tensor<2> {
        let [n, p] = patches_np.dims();
        let clips_btf = patches_np.reshape([n, p / n_features, n_features]);
        let latents_btc = self.encoder.valid().forward(clips_btf, &mut Pass::default());
        let [_, _, c] = latents_btc.dims();
        latents_btc.reshape([n, c])
    }

    /// A training pass: normalised features, `[b, t, f]`, and the quantizer's own term of the loss, `[1]`.
    /// Gradients pass through, and the quantizer learns what it learns on the host.
    pub fn reconstruct(
        &mut self,
        x_btf: Tensor<3>,
        pass: &mut Pass,
    ) -> (Tensor<3>, Option<Tensor<1>>) {
        let latents_btc = self.encoder.forward(x_btf, pass);
        let Quantized { quantized_btc, auxiliary_loss } = if self.codes_are_fixed {
            self.quantize_fixed(latents_btc.detach())
        } else {
            self.quantizer.quantize(latents_btc)
        };
        (self.decoder.forward(quantized_btc, pass), auxiliary_loss)
    }

    /// Embeddings of the codes of latents, without gradient; no code moves.
    fn quantize_fixed(&self, latents_btc: Tensor<3>) -> Quantized {
        let [n_clips, n_latents, _] = latents_btc.dims();
        let ids = self.quantizer.ids(latents_btc);
        let quantized_btc = self.quantizer.embed(&ids, Extent { n_clips, n_latents });
        Quantized { quantized_btc, auxiliary_loss: None }
    }

    /// The quantizer, which may learn beside the weights.
    pub(super) fn quantizer(&self) -> &dyn Quantizer {
        &*self.quantizer
    }

    /// The same, to be changed.
    pub(super) fn quantizer_mut(&mut self) -> &mut dyn Quantizer {
        &mut *self.quantizer
    }

    /// Codes of `[b, t, f]`, clip after clip.
    pub fn ids(&self, x_btf: Tensor<3>, captions: Option<&Captions>) -> Vec<u32> {
        self.quantizer.ids(self.encoder.forward(x_btf, &mut Pass::reading(captions)))
    }

    /// Features `[b, t, f]` of the codes of clips of one length.
    ///
    /// With language-free guidance g other than 0 these are (1 + g) m_c − g m_u, where m_c is what the
    /// captions give and m_u what is made without them (LG-Tok).
    pub fn decode(
        &self,
        ids: &[u32],
        extent: Extent,
        captions: Option<&Captions>,
        guidance: f64,
    ) -> Tensor<3> {
        let latents_btc = self.quantizer.embed(ids, extent);
        let made = |captions, latents_btc| {
            self.decoder.forward(latents_btc, &mut Pass::reading(Some(captions)))
        };
        match captions {
            None => self.decoder.forward(latents_btc, &mut Pass::default()),
            Some(captions) if guidance == 0.0 => made(captions, latents_btc),
            Some(captions) => {
                let none = Captions::none(extent.n_clips);
                let without = made(&none, latents_btc.clone());
                made(captions, latents_btc) * (1.0 + guidance) - without * guidance
            }
        }
    }
}
