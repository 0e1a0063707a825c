//! Both halves of a [`TransformerConfig`].

use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;

use super::config::TransformerConfig;
use super::decoder::TransformerDecoder;
use super::encoder::TransformerEncoder;
use crate::tokenizer::architecture::{AnyDecoder, AnyEncoder, Architecture};

impl Architecture for TransformerConfig {
    fn code_dim(&self) -> usize {
        self.sizes.latent
    }

    fn encoder(&self, rng: &mut ChaCha8Rng, device: &Device) -> AnyEncoder {
        AnyEncoder::Transformer(TransformerEncoder::new(self, rng, device))
    }

    fn decoder(&self, rng: &mut ChaCha8Rng, device: &Device) -> AnyDecoder {
        AnyDecoder::Transformer(TransformerDecoder::new(self, rng, device))
    }
}
