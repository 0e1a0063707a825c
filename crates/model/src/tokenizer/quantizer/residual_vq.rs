//! Residual vector quantization, as MoMask trains it (Guo et al. 2024, §3.1; Zeghidour et al. 2021).
//!
//! Layer k takes the code q_k nearest to what the layers before it leave over, r_k = z − Σ_{j<k} q_j,
//! and the decoder sees Σ q_k. Each layer is a codebook of moving averages and resets. The loss is the
//! mean of the commitment over layers,
//!
//! commitment · mean_k mean (r_k − q_k)².
//!
//! The gradient of the sum passes once, straight through, to the latents; in MoMask's code it passes
//! once a layer. MoMask also draws codes in training; here the nearest is taken. In a share of the steps
//! only the first layers take part, and those after them learn nothing.
//!
//! Shapes: b clips, t latents, n = b·t, c channels.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::dropout::Dropout;
use super::order::{by_clip, by_scale};
use super::{
    Extent, Quantized, Quantizer, Vq, clips, mean_square, rows, running_sums, states,
    straight_through,
};
use crate::learn::{LearnerState, LoadedState};
use crate::spec::{ResidualSpec, TokenizerTraining};

/// Learned codebooks after one another.
#[derive(Module, Debug)]
pub struct ResidualVq {
    layers: Vec<Vq>,
    /// Weight of the commitment term.
    #[module(skip)]
    commitment: f64,
    #[module(skip)]
    dropout: Dropout,
}

impl ResidualVq {
    /// Layers of `n_vocab` codes that k-means or the first batch will place.
    pub fn new(
        spec: &ResidualSpec,
        n_vocab: usize,
        code_dim: usize,
        training: &TokenizerTraining,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let layer = |_| Vq::new(n_vocab, code_dim, training, rng, device);
        let layers = (0..spec.layers).map(layer).collect();
        let dropout = Dropout::new(spec.dropout, rng);
        Self { layers, commitment: training.commitment, dropout }
    }

    /// The layers that a step uses: all of them where one has not been placed yet.
    fn used(&mut self) -> usize {
        let drawn = self.dropout.layers(self.layers.len());
        if self.layers.iter().all(Vq::is_placed) { drawn } else { self.layers.len() }
    }
}

impl Quantizer for ResidualVq {
    /// k-means of what the layers before leave over, layer after layer.
    fn begin(&mut self, latents_nc: &Tensor<2>) {
        let mut rest_nc = latents_nc.clone();
        for layer in &mut self.layers {
            layer.begin(&rest_nc);
            let plain = layer.valid();
            rest_nc = rest_nc.clone() - plain.rows_of(&plain.codes_of(&rest_nc));
        }
    }

    fn quantize(&mut self, latents_btc: Tensor<3>) -> Quantized {
        let n_clips = latents_btc.dims()[0];
        let latents_nc = rows(latents_btc);
        let used = self.used();
        let mut sum_nc = latents_nc.clone().detach().zeros_like();
        let mut commitment = Tensor::zeros([1], &latents_nc.device());
        for layer in &mut self.layers[..used] {
            let rest_nc = latents_nc.clone() - sum_nc.clone();
            let code_nc = layer.step(&rest_nc.clone().detach());
            commitment = commitment + mean_square(rest_nc, code_nc.clone());
            sum_nc = sum_nc + code_nc;
        }
        let auxiliary_loss = Some(commitment * (self.commitment / used as f64));
        let quantized_btc = clips(straight_through(sum_nc, latents_nc), n_clips);
        Quantized { quantized_btc, auxiliary_loss }
    }

    fn ids(&self, latents_btc: Tensor<3>) -> Vec<u32> {
        let n_clips = latents_btc.dims()[0];
        let latents_nc = rows(latents_btc);
        let mut sum_nc = latents_nc.zeros_like();
        let layers = self.layers.iter().map(|layer| {
            let ids = layer.codes_of(&(latents_nc.clone() - sum_nc.clone()));
            sum_nc = sum_nc.clone() + layer.rows_of(&ids);
            ids
        });
        by_clip(&layers.collect::<Vec<_>>(), n_clips)
    }

    fn lengths(&self, n_latents: usize) -> Vec<usize> {
        vec![n_latents; self.layers.len()]
    }

    fn codebooks(&self) -> Vec<Tensor<2>> {
        self.layers.iter().flat_map(Quantizer::codebooks).collect()
    }

    fn sums(&self, ids: &[u32], extent: Extent) -> Vec<Tensor<3>> {
        let lengths = self.lengths(extent.n_latents);
        let scales = by_scale(ids, &lengths, extent.n_clips);
        let codes = self.layers.iter().zip(&scales).map(|(layer, own)| layer.rows_of(own));
        running_sums(codes).map(|sum_nc| clips(sum_nc, extent.n_clips)).collect()
    }

    fn keep(&self) -> LearnerState {
        states::keep(self.layers.iter().map(|layer| layer as _), self.dropout.keep())
    }

    fn resume(&mut self, saved: LoadedState) -> Option<()> {
        let note = states::resume(self.layers.iter_mut().map(|layer| layer as _), saved)?;
        self.dropout.resume(&note)
    }
}
