//! [`Decoder`]: sequences that grow by a code at a time.
//!
//! Each position is turned by its place in its own sequence, so that the logits are those of a whole
//! pass over `[text | codes]`.
//!
//! Shapes: b sequences, p positions of the longest text.

use std::sync::Arc;

use burn::tensor::Tensor;

use super::transformer::Model;
use crate::generator::stack::{Growing, padded};

/// Sequences that grow side by side.
pub struct Decoder<'a> {
    model: &'a Model,
    growing: Growing<'a>,
    /// Codes of each sequence so far.
    n_codes: usize,
}

impl<'a> Decoder<'a> {
    /// Sequences of text alone, `[n_text, d_text]` each, at least one row; and the logits of their
    /// first codes, `[b, V + 1]`.
    pub fn new(model: &'a Model, texts: &[&[f32]]) -> (Self, Tensor<2>) {
        let (backbone, d_text) = (&model.backbone, model.shape().d_text);
        let prefixes: Vec<usize> = texts.iter().map(|text| text.len() / d_text).collect();
        let mut growing = Growing::new(backbone, &model.weights.blocks, prefixes);
        let (b, p) = (texts.len(), growing.longest_text());
        let x_nd = model.embed_text(padded(texts, p * d_text));
        let angles: Vec<usize> = (0..b).flat_map(|_| 0..p).collect();
        let x_nd = growing.text(x_nd, &angles);
        let last = growing.prefixes().iter().enumerate().map(|(i, n)| (i * p + n - 1) as u32);
        let logits = model.head_logits(backbone.kernels.select_rows(x_nd, &Arc::from_iter(last)));
        (Self { model, growing, n_codes: 0 }, logits)
    }

    /// A code for each sequence joins it; the logits of what follows, `[b, V + 1]`. A sequence that
    /// is whole goes on beside the others, unread, and may leave the context.
    pub fn push(&mut self, codes: &Arc<[u32]>) -> Tensor<2> {
        let last = self.model.shape().n_ctx - 1;
        let angle = |prefix: &usize| (prefix + self.n_codes).min(last);
        let angles: Vec<usize> = self.growing.prefixes().iter().map(angle).collect();
        self.n_codes += 1;
        let x_bd = self.growing.join(self.model.embed_codes(codes), &angles, &[]);
        self.model.head_logits(x_bd)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generator::autoregressive::{Batch, Sequence};
    use crate::ops::Kernels;
    use crate::spec::{Ffn, ModelShape};
    use burn::tensor::Device;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    const CODES: [[u32; 4]; 2] = [[3, 1, 4, 1], [0, 5, 2, 5]];

    fn model(device: &Device) -> Model {
        let shape = ModelShape {
            n_layer: 2,
            n_head: 2,
            d_model: 12,
            d_ff: 16,
            n_ctx: 12,
            d_text: 3,
            ffn: Ffn::SwiGlu,
            tie_embeddings: false,
            rope_base: 10_000.0,
        };
        let model = Model::init(&shape, 6, &mut ChaCha8Rng::seed_from_u64(4), device);
        Model::new(model.weights, &shape, 6, Kernels::for_device(device), device)
    }

    fn texts() -> [Vec<f32>; 2] {
        [5, 2].map(|n| (0..3 * n).map(|i| (i as f32 * 1.7 + n as f32).sin()).collect())
    }

    /// The logits of the last `n + 1` targets after a text and codes, in one pass.
    fn whole(model: &Model, text: &[f32], codes: &[u32]) -> Vec<f32> {
        let sequence = Sequence { text, codes, from: codes.len(), to: codes.len() + 1 };
        let logits = model.logits(&Batch::pack(&[sequence], 3, 6));
        logits.into_data().try_into_vec().unwrap()
    }

    #[test]
    fn logits_are_those_of_a_whole_pass_whatever_stands_beside_a_sequence() {
        let device = Device::flex();
        let (model, texts) = (model(&device), texts());
        let refs: Vec<&[f32]> = texts.iter().map(Vec::as_slice).collect();
        let (mut decoder, mut logits) = Decoder::new(&model, &refs);
        for step in 0..=4 {
            let found: Vec<f32> = logits.clone().into_data().try_into_vec().unwrap();
            for (i, text) in texts.iter().enumerate() {
                let expected = whole(&model, text, &CODES[i][..step]);
                let own = &found[i * 7..][..7];
                let off = own.iter().zip(&expected).map(|(a, b)| (a - b).abs());
                assert!(off.fold(0.0, f32::max) < 1e-5, "{step} {i}: {own:?} {expected:?}");
            }
            if step < 4 {
                logits = decoder.push(&CODES.map(|codes| codes[step]).into());
            }
        }
    }
}
