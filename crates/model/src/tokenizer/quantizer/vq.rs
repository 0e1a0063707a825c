//! Vector quantization with a codebook of moving averages and resets, as T2M-GPT trains it.
//!
//! Each latent takes the nearest code. After each step, with μ = 0.99,
//!
//! sum ← μ sum + (1 − μ) Σ latents of the code, count ← μ count + (1 − μ) their number,
//!
//! and the code becomes sum / count. A code that is met too rarely is placed anew, at a latent of the
//! batch: by T2M-GPT's rule one whose count is below 1, at once and for this step; by the rule of
//! shares one whose count is below a share of the mean, as if it had been met as often as the mean. The
//! codebook has no gradient; the latents are drawn to their codes by commitment · mean (latent − code)².
//!
//! The codebook begins as the first latents of the first batch, or by k-means.
//!
//! Shapes: n latents, c channels, v codes.

use burn::module::{Module, Param};
use burn::tensor::{Device, Int, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::averages::Averages;
use super::k_means::k_means;
use super::nearest::nearest_direction;
use super::{Extent, Quantized, Quantizer, clips, mean_square, rows, straight_through};
use crate::learn::{LearnerState, LoadedState};
use crate::ops::nearest;
use crate::spec::TokenizerTraining;
use crate::tokenizer::axes::host;

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
            averages: Averages { reset_share, ..Averages::new(n_vocab, code_dim, rng) },
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
        let find = if self.cosine { nearest_direction } else { nearest };
        find(latents_nc, &self.codebook.val())
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

#[cfg(test)]
mod tests;
