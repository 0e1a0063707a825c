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

use serde_json::json;

use super::k_means::k_means;
use super::nearest::nearest;
use super::{Quantized, Quantizer, clips, rows};
use crate::learn::weights::{HostTensor, Source};
use crate::learn::{LearnerState, LoadedState, params};
use crate::spec::TokenizerTraining;

/// μ.
const DECAY: f32 = 0.99;
/// A code met less often than this, on average and per step, is replaced by T2M-GPT's rule.
const LEAST_COUNT: f32 = 1.0;
/// What a code of k-means counts as having been met.
const FIRST_COUNT: f32 = 10.0;

/// A learned codebook.
#[derive(Module, Debug)]
pub struct Vq {
    /// `[v, c]`, without gradient.
    codebook: Param<Tensor<2>>,
    /// Weight of the commitment term.
    #[module(skip)]
    commitment: f64,
    #[module(skip)]
    averages: Averages,
}

/// The moving averages that a codebook follows from.
#[derive(Clone, Debug)]
struct Averages {
    /// Row-major `[v, c]`; empty until the first batch has been seen.
    sums: Vec<f32>,
    /// `[v]`.
    counts: Vec<f32>,
    n_vocab: usize,
    code_dim: usize,
    /// A code met by less than this share of the mean is placed anew; 0: T2M-GPT's rule.
    reset_share: f32,
    /// For the noise on latents that stand for several codes, and for codes that are placed anew.
    rng: ChaCha8Rng,
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
            averages: Averages { reset_share, ..Averages::new(n_vocab, code_dim, rng) },
        }
    }

    fn set_codebook(&mut self, codes: Vec<f32>) {
        let data = TensorData::new(codes, self.codebook.dims());
        let codes = Tensor::from_data(data, &self.codebook.device());
        self.codebook = Param::initialized(self.codebook.id, codes);
    }

    /// The code of each latent.
    fn codes_of(&self, latents_nc: &Tensor<2>) -> Vec<u32> {
        nearest(latents_nc, &self.codebook.val())
    }

    /// The embedding of each code, `[n, c]`.
    fn rows_of(&self, ids: &[u32]) -> Tensor<2> {
        let codebook = self.codebook.val();
        let rows: Vec<i32> = ids.iter().map(|&id| id as i32).collect();
        let data = TensorData::new(rows, [ids.len()]);
        let rows = Tensor::<1, Int>::from_data(data, &codebook.device());
        codebook.select(0, rows)
    }
}

impl Quantizer for Vq {
    fn quantize(&mut self, latents_btc: Tensor<3>) -> Quantized {
        let n_clips = latents_btc.dims()[0];
        let latents_nc = rows(latents_btc);
        let on_host = latents_nc.clone().into_data().try_into_vec().expect("latents are f32");
        if self.averages.sums.is_empty() {
            let codes = self.averages.start(&on_host);
            self.set_codebook(codes);
        }
        let ids = self.codes_of(&latents_nc.clone().detach());
        let embedded = self.rows_of(&ids);
        let codes = self.averages.follow(&on_host, &ids);
        self.set_codebook(codes);
        let apart = latents_nc.clone() - embedded.clone();
        // The bracket is exactly 0: the value is the code's and the gradient the latent's.
        let straight = embedded + (latents_nc.clone() - latents_nc.detach());
        let commitment = (apart.clone() * apart).mean() * self.commitment;
        Quantized { quantized_btc: clips(straight, n_clips), auxiliary_loss: Some(commitment) }
    }

    fn begin(&mut self, latents_nc: &Tensor<2>) {
        let averages = &mut self.averages;
        let codes = k_means(latents_nc, averages.n_vocab, &mut averages.rng);
        averages.sums = codes.iter().map(|x| x * FIRST_COUNT).collect();
        averages.counts.fill(FIRST_COUNT);
        self.set_codebook(codes);
    }

    fn ids(&self, latents_btc: Tensor<3>) -> Vec<u32> {
        self.codes_of(&rows(latents_btc))
    }

    fn embed(&self, ids: &[u32], n_clips: usize) -> Tensor<3> {
        clips(self.rows_of(ids), n_clips)
    }

    /// The sums and counts of its codes, and how far its generator has come: as text, since that has
    /// 68 bits.
    fn keep(&self) -> LearnerState {
        let Averages { sums, counts, rng, .. } = &self.averages;
        let row = |values: &[f32]| {
            Source::Host(HostTensor { shape: vec![values.len()], values: values.to_vec() })
        };
        let tensors = [(SUMS.to_string(), row(sums)), (COUNTS.to_string(), row(counts))];
        LearnerState {
            note: json!({ DRAWN: rng.get_word_pos().to_string() }),
            tensors: tensors.into(),
        }
    }

    fn resume(&mut self, mut saved: LoadedState) -> Option<()> {
        let drawn: u128 = saved.note[DRAWN].as_str()?.parse().ok()?;
        self.averages.sums = saved.tensors.remove(SUMS)?.values;
        self.averages.counts = saved.tensors.remove(COUNTS)?.values;
        self.averages.rng.set_word_pos(drawn);
        Some(())
    }
}

const SUMS: &str = "sums";
const COUNTS: &str = "counts";
const DRAWN: &str = "drawn";

impl Averages {
    fn new(n_vocab: usize, code_dim: usize, rng: ChaCha8Rng) -> Self {
        let (sums, counts) = (Vec::new(), vec![1.0; n_vocab]);
        Self { sums, counts, n_vocab, code_dim, reset_share: 0.0, rng }
    }

    /// The codebook of the first batch: its first latents.
    fn start(&mut self, latents: &[f32]) -> Vec<f32> {
        self.sums = self.candidates(latents);
        self.sums.clone()
    }

    /// The codebook after a batch.
    fn follow(&mut self, latents: &[f32], ids: &[u32]) -> Vec<f32> {
        self.add(latents, ids);
        if self.reset_share > 0.0 {
            return self.codes_by_shares(latents);
        }
        let mut codes = self.candidates(latents);
        let rows = codes.chunks_exact_mut(self.code_dim);
        let averages = self.sums.chunks_exact(self.code_dim).zip(&self.counts);
        for (code, (sum, &count)) in rows.zip(averages) {
            if count >= LEAST_COUNT {
                code.iter_mut().zip(sum).for_each(|(code, sum)| *code = sum / count);
            }
        }
        codes
    }

    /// The codebook after a batch, by the rule of shares.
    fn codes_by_shares(&mut self, latents: &[f32]) -> Vec<f32> {
        let c = self.code_dim;
        let n = latents.len() / c;
        let mean = n as f32 / self.n_vocab as f32;
        for (id, count) in self.counts.iter_mut().enumerate() {
            if *count < self.reset_share * mean {
                let latent = &latents[params::below(&mut self.rng, n) * c..][..c];
                let sum = &mut self.sums[id * c..][..c];
                sum.iter_mut().zip(latent).for_each(|(sum, x)| *sum = x * mean);
                *count = mean;
            }
        }
        let rows = self.sums.chunks_exact(c).zip(&self.counts);
        rows.flat_map(|(sum, count)| sum.iter().map(move |x| x / count)).collect()
    }

    fn add(&mut self, latents: &[f32], ids: &[u32]) {
        self.sums.iter_mut().chain(&mut self.counts).for_each(|average| *average *= DECAY);
        for (latent, &id) in latents.chunks_exact(self.code_dim).zip(ids) {
            let id = id as usize;
            self.counts[id] += 1.0 - DECAY;
            let sum = &mut self.sums[id * self.code_dim..][..self.code_dim];
            sum.iter_mut().zip(latent).for_each(|(sum, x)| *sum += (1.0 - DECAY) * x);
        }
    }

    /// One latent for each code, `[v, c]`: the batch's first ones, or, where it has too few, all of
    /// them over and over with noise of deviation 0.01/√c.
    fn candidates(&mut self, latents: &[f32]) -> Vec<f32> {
        let wanted = self.n_vocab * self.code_dim;
        let taken = latents.iter().copied().cycle().take(wanted);
        if latents.len() >= wanted {
            return taken.collect();
        }
        let deviation = 0.01 / (self.code_dim as f64).sqrt();
        let noise = params::normal([wanted], deviation, &mut self.rng, &Device::flex()).val();
        let noise = noise.into_data().try_into_vec::<f32>().expect("noise is f32");
        taken.zip(noise).map(|(latent, noise)| latent + noise).collect()
    }
}

#[cfg(test)]
mod tests;
