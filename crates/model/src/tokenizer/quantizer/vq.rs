//! Vector quantization: with one codebook, or residual, with several in sequence.
//!
//! # One codebook
//!
//! Moving averages and resets, as in T2M-GPT.
//!
//! Each latent takes the nearest code. After each step, with μ = 0.99,
//!
//! sum ← μ sum + (1 − μ) Σ latents of the code, count ← μ count + (1 − μ) their number,
//!
//! and the code becomes sum / count. A code that is used too rarely is reset to a latent of the batch: by T2M-GPT's rule
//! if its count is below 1, at once and for this step; by the rule of shares if its count is below a fraction of the
//! mean, with the mean count. The codebook has no gradient; the latents are drawn to their codes by commitment · mean
//! (latent − code)².
//!
//! The codebook starts as the first latents of the first batch, or by k-means.
//!
//! # Residual
//!
//! As in MoMask (Guo et al. 2024, §3.1; Zeghidour et al. 2021).
//!
//! Layer k takes the code q_k nearest to the residual of earlier layers, r_k = z − Σ_{j<k} q_j, and the decoder gets
//! Σ q_k. Each layer is a codebook with moving averages and resets. The loss is the mean commitment over layers,
//!
//! commitment · mean_k mean (r_k − q_k)².
//!
//! The gradient of the sum passes straight through to the latents once; in MoMask's code once per layer. MoMask also
//! samples codes in training; here the nearest is taken. In a fraction of the steps only the first layers are used, and
//! later ones are not updated.
//!
//! Shapes: b clips, t latents, n = b·t, c channels, v codes.

use burn::module::{Module, Param};
use burn::tensor::{Device, Int, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::averages::{Averages, k_means};
use super::{
    Dropout, Extent, Quantized, Quantizer, by_clip, by_scale, clips, keep_parts, mean_square,
    resume_parts, rows, running_sums, straight_through,
};
use crate::learn::{LearnerState, LoadedState};
use crate::ops::nearest;
use crate::spec::{ResidualSpec, TokenizerTraining};
use crate::tokenizer::halves::host;

/// Length that a row is taken to have at least before it is made 1 long.
const SHORTEST: f64 = 1e-12;

/// A learned codebook.
#[derive(Module, Debug)]
pub struct Vq {
    /// `[v, c]`, without gradient.
    codebook: Param<Tensor<2>>,
    /// Weight of the commitment term.
    #[module(skip)]
    commitment: f64,
    /// Whether latents and codes are compared by direction.
    #[module(skip)]
    pub cosine: bool,
    #[module(skip)]
    averages: Averages,
}

impl Vq {
    /// `n_vocab` codes that k-means or the first batch will place.
    pub fn new(
        n_vocab: usize,
        code_dim: usize,
        training: &TokenizerTraining,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let codebook = Param::from_tensor(Tensor::zeros([n_vocab, code_dim], device));
        let rng = ChaCha8Rng::seed_from_u64(rng.next_u64());
        let reset_share = training.reset_share as f32;
        Self {
            codebook: codebook.set_require_grad(false),
            commitment: training.commitment,
            cosine: false,
            averages: Averages::new(n_vocab, code_dim, reset_share, rng),
        }
    }

    fn set_codebook(&mut self, codes: Vec<f32>) {
        let data = TensorData::new(codes, self.codebook.dims());
        let codes = Tensor::from_data(data, &self.codebook.device());
        self.codebook = Param::initialized(self.codebook.id, codes);
    }

    /// Whether its codes have been placed.
    pub fn is_placed(&self) -> bool {
        !self.averages.sums.is_empty()
    }

    /// Places the codes at the first latents of a batch, unless they have been placed.
    pub fn place(&mut self, latents_nc: &Tensor<2>) {
        if !self.is_placed() {
            let codes = self.averages.start(&host(latents_nc.clone()));
            self.set_codebook(codes);
        }
    }

    /// Moves the codes after a batch of latents, each of which has taken a code.
    pub fn follow(&mut self, latents_nc: &Tensor<2>, ids: &[u32]) {
        let codes = self.averages.follow(&host(latents_nc.clone()), ids);
        self.set_codebook(codes);
    }

    /// The code of each latent.
    pub fn codes_of(&self, latents_nc: &Tensor<2>) -> Vec<u32> {
        let codes_vc = self.codebook.val();
        if self.cosine {
            return nearest(&directions(latents_nc), &directions(&codes_vc));
        }
        nearest(latents_nc, &codes_vc)
    }

    /// The embedding of each code, `[n, c]`.
    pub fn rows_of(&self, ids: &[u32]) -> Tensor<2> {
        let codebook = self.codebook.val();
        let rows: Vec<i32> = ids.iter().map(|&id| id as i32).collect();
        let data = TensorData::new(rows, [ids.len()]);
        let rows = Tensor::<1, Int>::from_data(data, &codebook.device());
        codebook.select(0, rows)
    }

    /// A step on latents without gradient: the embeddings of their codes, after which the codes move.
    pub fn step(&mut self, latents_nc: &Tensor<2>) -> Tensor<2> {
        self.place(latents_nc);
        let ids = self.codes_of(latents_nc);
        let embedded_nc = self.rows_of(&ids);
        self.follow(latents_nc, &ids);
        embedded_nc
    }
}

impl Quantizer for Vq {
    fn quantize(&mut self, latents_btc: Tensor<3>) -> Quantized {
        let n_clips = latents_btc.dims()[0];
        let latents_nc = rows(latents_btc);
        let embedded_nc = self.step(&latents_nc.clone().detach());
        let commitment = mean_square(latents_nc.clone(), embedded_nc.clone()) * self.commitment;
        let quantized_btc = clips(straight_through(embedded_nc, latents_nc), n_clips);
        Quantized { quantized_btc, auxiliary_loss: Some(commitment) }
    }

    fn begin(&mut self, latents_nc: &Tensor<2>) {
        let averages = &mut self.averages;
        let codes = k_means(latents_nc, averages.n_vocab, &mut averages.rng);
        averages.begin(&codes);
        self.set_codebook(codes);
    }

    fn ids(&self, latents_btc: Tensor<3>) -> Vec<u32> {
        self.codes_of(&rows(latents_btc))
    }

    fn codebooks(&self) -> Vec<Tensor<2>> {
        vec![self.codebook.val()]
    }

    fn sums(&self, ids: &[u32], extent: Extent) -> Vec<Tensor<3>> {
        vec![clips(self.rows_of(ids), extent.n_clips)]
    }

    fn keys(&self) -> Vec<[u8; 32]> {
        vec![self.averages.rng.get_seed()]
    }

    fn keep(&self) -> LearnerState {
        self.averages.keep()
    }

    fn resume(&mut self, saved: LoadedState) -> Option<()> {
        self.averages.resume(saved)
    }
}

/// Rows of length 1; a row of zeros stays one.
fn directions(rows_nc: &Tensor<2>) -> Tensor<2> {
    let norms_n1 = (rows_nc.clone() * rows_nc.clone()).sum_dim(1).sqrt();
    rows_nc.clone() / norms_n1.clamp_min(SHORTEST)
}

// Codebooks after one another.

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

    /// The layers of a step: all of them if one is not initialised yet.
    fn used(&mut self) -> usize {
        let drawn = self.dropout.layers(self.layers.len());
        if self.layers.iter().all(Vq::is_placed) { drawn } else { self.layers.len() }
    }
}

impl Quantizer for ResidualVq {
    /// k-means of the residuals, layer by layer.
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
        keep_parts(self.layers.iter().map(|layer| layer as _), self.dropout.keep())
    }

    fn resume(&mut self, saved: LoadedState) -> Option<()> {
        let note = resume_parts(self.layers.iter_mut().map(|layer| layer as _), saved)?;
        self.dropout.resume(&note)
    }
}

#[cfg(test)]
mod tests {
    use super::super::averages::FIRST_COUNT;
    use super::*;
    use crate::learn::params;

    fn vq(n_vocab: usize, code_dim: usize, device: &Device) -> Vq {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        Vq::new(n_vocab, code_dim, &TokenizerTraining::default(), &mut rng, device)
    }

    #[test]
    fn k_means_places_codes_among_the_latents() {
        let device = Device::flex();
        let mut vq = vq(2, 1, &device);
        vq.begin(&Tensor::from_data([[1.0], [1.2], [9.0], [9.2]], &device));
        let mut codes = host(vq.codebook.val());
        codes.sort_by(f32::total_cmp);
        assert!((codes[0] - 1.1).abs() < 1e-5 && (codes[1] - 9.1).abs() < 1e-5, "{codes:?}");
        assert_eq!(vq.averages.counts, [FIRST_COUNT; 2]);
    }

    #[test]
    fn the_nearest_code_is_taken_and_embedded() {
        let device = Device::flex();
        let mut vq = vq(3, 2, &device);
        vq.set_codebook(vec![0.0, 0.0, 1.0, 1.0, -1.0, 3.0]);
        let latents = Tensor::<3>::from_data([[[0.9, 0.8], [-0.2, 0.1], [-2.0, 2.0]]], &device);
        let ids = vq.ids(latents);
        assert_eq!(ids, [1, 0, 2]);
        let embedded = vq.embed(&ids, Extent { n_clips: 1, n_latents: 3 });
        assert_eq!(host(embedded), [1.0, 1.0, 0.0, 0.0, -1.0, 3.0]);
    }

    #[test]
    fn gradients_reach_the_latents_and_not_the_codebook() {
        let device = Device::flex().autodiff();
        let mut vq = vq(2, 1, &device);
        let latents = params::constant([1, 3, 1], 0.5, &device).val();
        let quantized = vq.quantize(latents.clone());
        let loss = quantized.quantized_btc.sum() + quantized.auxiliary_loss.unwrap();
        let grads = loss.backward();
        let grad = host(latents.grad(&grads).unwrap());
        assert!(grad.iter().all(|g| (g - 1.0).abs() < 1e-3), "{grad:?}");
        assert!(vq.codebook.val().grad(&grads).is_none());
    }
}
