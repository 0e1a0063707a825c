//! [`Averages`]: how the codes of a learned codebook move, on the host.
//!
//! Shapes: n latents, c channels, v codes.

use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use serde_json::json;

use crate::learn::weights::{HostTensor, Source};
use crate::learn::{LearnerState, LoadedState, params};

/// μ.
const DECAY: f32 = 0.99;
/// A code met less often than this, on average and per step, is replaced by T2M-GPT's rule.
const LEAST_COUNT: f32 = 1.0;
/// What a code of k-means counts as having been met.
pub const FIRST_COUNT: f32 = 10.0;

/// The moving averages that a codebook follows from.
#[derive(Clone, Debug)]
pub struct Averages {
    /// Row-major `[v, c]`; empty until the first batch has been seen.
    pub sums: Vec<f32>,
    /// `[v]`.
    pub counts: Vec<f32>,
    pub n_vocab: usize,
    pub code_dim: usize,
    /// A code met by less than this share of the mean is placed anew; 0: T2M-GPT's rule.
    pub reset_share: f32,
    /// For the noise on latents that stand for several codes, and for codes that are placed anew.
    pub rng: ChaCha8Rng,
}

const SUMS: &str = "sums";
const COUNTS: &str = "counts";
const DRAWN: &str = "drawn";

impl Averages {
    /// Those of codes that nothing has placed yet.
    pub fn new(n_vocab: usize, code_dim: usize, rng: ChaCha8Rng) -> Self {
        let (sums, counts) = (Vec::new(), vec![1.0; n_vocab]);
        Self { sums, counts, n_vocab, code_dim, reset_share: 0.0, rng }
    }

    /// The codebook of the first batch: its first latents.
    pub fn start(&mut self, latents: &[f32]) -> Vec<f32> {
        self.sums = self.candidates(latents);
        self.sums.clone()
    }

    /// The codebook after a batch.
    pub fn follow(&mut self, latents: &[f32], ids: &[u32]) -> Vec<f32> {
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

    /// Those of codes that k-means has placed.
    pub fn begin(&mut self, codes: &[f32]) {
        self.sums = codes.iter().map(|x| x * FIRST_COUNT).collect();
        self.counts.fill(FIRST_COUNT);
    }

    /// The sums and counts of the codes, and how far the generator has come: as text, since that has
    /// 68 bits.
    pub fn keep(&self) -> LearnerState {
        let row = |values: &[f32]| {
            Source::Host(HostTensor { shape: vec![values.len()], values: values.to_vec() })
        };
        let tensors =
            [(SUMS.to_string(), row(&self.sums)), (COUNTS.to_string(), row(&self.counts))];
        LearnerState {
            note: json!({ DRAWN: self.rng.get_word_pos().to_string() }),
            tensors: tensors.into(),
        }
    }

    /// Takes up what [`Averages::keep`] gave; `None` where it is not that.
    pub fn resume(&mut self, mut saved: LoadedState) -> Option<()> {
        let drawn: u128 = saved.note[DRAWN].as_str()?.parse().ok()?;
        self.sums = saved.tensors.remove(SUMS)?.values;
        self.counts = saved.tensors.remove(COUNTS)?.values;
        self.rng.set_word_pos(drawn);
        Some(())
    }
}
