//! Initialises the codes of a learned codebook by k-means (Lloyd 1982) or from the first batch, and updates them by
//! [`Averages`], on the host.
//!
//! Shapes: n latents, c channels, v codes or centres.

use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use serde_json::json;

use crate::draws::{below, distinct};
use crate::learn::params;
use crate::learn::weights::{HostTensor, Source};
use crate::learn::{LearnerState, LoadedState};
use crate::ops::nearest;
use crate::progress::moved;
use crate::tokenizer::halves::host;

/// μ.
const DECAY: f32 = 0.99;
/// A code met less often than this, on average and per step, is replaced by T2M-GPT's rule.
const LEAST_COUNT: f32 = 1.0;
/// The initial count of a k-means code.
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
    /// A code used less than this fraction of the mean is reset; 0 for T2M-GPT's rule.
    pub reset_share: f32,
    /// Random numbers for the noise on latents shared by several codes, and for resets.
    pub rng: ChaCha8Rng,
}

const SUMS: &str = "sums";
const COUNTS: &str = "counts";
const DRAWN: &str = "drawn";

impl Averages {
    /// Codes that are not initialised yet.
    pub fn new(n_vocab: usize, code_dim: usize, reset_share: f32, rng: ChaCha8Rng) -> Self {
        let (sums, counts) = (Vec::new(), vec![1.0; n_vocab]);
        Self { sums, counts, n_vocab, code_dim, reset_share, rng }
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
                let latent = &latents[below(&mut self.rng, n) * c..][..c];
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

    /// One latent for each code, `[v, c]`: the batch's first ones, or, if it has too few, all of them repeatedly with noise
    /// of standard deviation 0.01/√c.
    fn candidates(&mut self, latents: &[f32]) -> Vec<f32> {
        let wanted = self.n_vocab * self.code_dim;
        let taken = latents.iter().copied().cycle().take(wanted);
        if latents.len() >= wanted {
            return taken.collect();
        }
        let deviation = 0.01 / (self.code_dim as f64).sqrt();
        let noise = params::normal([wanted], deviation, &mut self.rng, &Device::flex()).val();
        taken.zip(host(noise)).map(|(latent, noise)| latent + noise).collect()
    }

    /// Codes initialised by k-means.
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

    /// Restores the state of [`Averages::keep`]; `None` if it does not fit.
    pub fn resume(&mut self, mut saved: LoadedState) -> Option<()> {
        let drawn: u128 = saved.note[DRAWN].as_str()?.parse().ok()?;
        self.sums = saved.tensors.remove(SUMS)?.values;
        self.counts = saved.tensors.remove(COUNTS)?.values;
        self.rng.set_word_pos(drawn);
        Some(())
    }
}

/// Rounds after which the centres are taken.
const ROUNDS: usize = 15;

/// `n_centres` centres, row-major `[v, c]`, from latents drawn at random; a centre that no latent is
/// nearest to becomes another latent.
pub fn k_means(latents_nc: &Tensor<2>, n_centres: usize, rng: &mut ChaCha8Rng) -> Vec<f32> {
    let [n, c] = latents_nc.dims();
    let latents = host(latents_nc.clone());
    let latent = |i: usize| &latents[i * c..][..c];
    let first = distinct(n, n_centres, rng);
    let mut centres: Vec<f32> =
        first.iter().cycle().take(n_centres).flat_map(|i| latent(*i)).copied().collect();
    for _ in 0..ROUNDS {
        let data = TensorData::new(centres.clone(), [n_centres, c]);
        let ids = nearest(latents_nc, &Tensor::from_data(data, &latents_nc.device()));
        let (mut sums, mut counts) = (vec![0.0; n_centres * c], vec![0usize; n_centres]);
        for (latent, &id) in latents.chunks_exact(c).zip(&ids) {
            counts[id as usize] += 1;
            let sum = &mut sums[id as usize * c..][..c];
            sum.iter_mut().zip(latent).for_each(|(sum, x)| *sum += f64::from(*x));
        }
        for (v, count) in counts.into_iter().enumerate() {
            let centre = &mut centres[v * c..][..c];
            match count {
                0 => centre.copy_from_slice(latent(below(rng, n))),
                _ => {
                    let sums = sums[v * c..].iter();
                    centre
                        .iter_mut()
                        .zip(sums)
                        .for_each(|(x, sum)| *x = (sum / count as f64) as f32);
                }
            }
        }
        moved();
    }
    centres
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::rand_core::SeedableRng;

    fn averages(n_vocab: usize) -> Averages {
        Averages::new(n_vocab, 1, 0.0, ChaCha8Rng::seed_from_u64(0))
    }

    #[test]
    fn a_code_that_falls_out_of_use_is_replaced_by_a_latent_of_the_batch() {
        let mut averages = averages(2);
        assert_eq!(averages.start(&[5.0, -5.0, 6.0]), [5.0, -5.0]);
        // Code 1 is not met: its count falls to 0.99, so it is reset. Code 0 is met three times.
        let codes = averages.follow(&[7.0, 8.0, 9.0], &[0, 0, 0]);
        assert_eq!(codes[1], 8.0);
        let expected = (0.99 * 5.0 + 0.01 * 24.0) / (0.99 + 0.03);
        assert!((codes[0] - expected).abs() < 1e-5, "{codes:?}");
    }

    #[test]
    fn by_the_rule_of_shares_a_rare_code_counts_as_the_mean_from_then_on() {
        let mut averages = Averages { reset_share: 0.5, ..averages(2) };
        (averages.sums, averages.counts) = (vec![50.0, -0.1], vec![10.0, 0.1]);
        // Two latents a step, so the mean is 1: code 1 is below half of it.
        let codes = averages.follow(&[7.0, 7.0], &[0, 0]);
        assert_eq!((codes[1], averages.counts[1]), (7.0, 1.0));
        let expected = (0.99 * 50.0 + 0.01 * 14.0) / (0.99 * 10.0 + 0.02);
        assert!((codes[0] - expected).abs() < 1e-4, "{codes:?}");
    }

    #[test]
    fn a_small_batch_fills_a_large_codebook_with_noisy_copies() {
        let codes = averages(7).start(&[1.0, 2.0, 3.0]);
        let distance = |(i, code): (usize, &f32)| (code - [1.0, 2.0, 3.0][i % 3]).abs();
        assert!(codes.iter().enumerate().map(distance).all(|d| d > 0.0 && d < 0.1), "{codes:?}");
        assert_ne!(codes[0], codes[3]);
    }

    #[test]
    fn clusters_are_found() {
        let values: Vec<f32> = (0..300).map(|i| (i % 3) as f32 * 10.0 + (i as f32).sin()).collect();
        let latents = Tensor::from_data(TensorData::new(values, [300, 1]), &Device::flex());
        // A start with two centres in one cluster may stay there; one of these does not.
        let found = (0..4).any(|seed| {
            let mut centres = k_means(&latents, 3, &mut ChaCha8Rng::seed_from_u64(seed));
            centres.sort_by(f32::total_cmp);
            let mut pairs = centres.iter().zip([0.0, 10.0, 20.0]);
            pairs.all(|(found, centre)| (found - centre).abs() < 0.3)
        });
        assert!(found);
    }

    #[test]
    fn more_centres_than_latents_repeat_them() {
        let latents = Tensor::from_data([[1.0], [2.0]], &Device::flex());
        assert_eq!(k_means(&latents, 5, &mut ChaCha8Rng::seed_from_u64(0)).len(), 5);
    }
}
