//! The multi-scale quantizer of LG-Tok, after VAR (Tian et al. 2024): residual quantization in which
//! layer n sees the clip at s_n latents, whatever its length.
//!
//! Of the latents z (t of them) and the scales s_1 < … < s_K, each with its own codebook:
//!
//! ids_n = nearest(area_down(r_n, s_n)), h_n = φ_n(linear_up(codes of ids_n, t)),
//! r_{n+1} = r_n − h_n, r_1 = z, ẑ_n = Σ_{j≤n} h_j,
//!
//! and the decoder sees ẑ_K with the gradient passed straight through to z. The loss is
//!
//! commitment · mean_n [β · mean (sg(ẑ_n) − z)² + mean (ẑ_n − sg(z))²];
//!
//! its second term alone trains φ and, where the codebooks are FSQ, their projections. A codebook of VQ
//! moves towards the latents that take its codes among the t of r_n, not among the s_n that were looked
//! up (LG-Tok's code). Its codes begin as latents z themselves.
//!
//! Shapes: b clips, t latents, c channels, s codes of a clip on a scale.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::codebook::Codebook;
use super::order::{by_clip, by_scale};
use super::smoothing::Smoothing;
use super::{
    Extent, Quantized, Quantizer, area_down, clips, linear_up, mean_square, rows, running_sums,
    states, straight_through,
};
use crate::learn::{LearnerState, LoadedState};
use crate::spec::{MultiscaleSpec, TokenizerTraining};

/// Codebooks of several lengths.
#[derive(Module, Debug)]
pub struct Multiscale {
    codebooks: Vec<Codebook>,
    /// φ of each scale.
    smoothings: Vec<Smoothing>,
    #[module(skip)]
    scales: Vec<usize>,
    #[module(skip)]
    commitment: f64,
    #[module(skip)]
    beta: f64,
}

impl Multiscale {
    /// Codebooks that k-means or the first batch will place.
    pub fn new(
        spec: &MultiscaleSpec,
        code_dim: usize,
        training: &TokenizerTraining,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let codebooks = spec.codebooks.iter();
        let codebooks = codebooks
            .map(|own| Codebook::new(own, spec.cosine, code_dim, training, rng, device))
            .collect();
        let smoothing = |_: &usize| Smoothing::new(spec.mix, code_dim, rng, device);
        Self {
            codebooks,
            smoothings: spec.scales.iter().map(smoothing).collect(),
            scales: spec.scales.clone(),
            commitment: training.commitment,
            beta: spec.beta,
        }
    }

    /// h of scale `n` from the embeddings of its codes, `[b·s, c]` to `[b, t, c]`.
    fn added(&self, n: usize, embedded: Tensor<2>, extent: Extent) -> Tensor<3> {
        let embedded_bsc = clips(embedded, extent.n_clips);
        self.smoothings[n].forward(linear_up(embedded_bsc, extent.n_latents))
    }

    /// r of scale `n` at its length, as rows, `[b·s, c]`.
    fn shortened(&self, n: usize, rest_btc: &Tensor<3>) -> Tensor<2> {
        rows(area_down(rest_btc.clone(), self.scales[n]))
    }
}

impl Quantizer for Multiscale {
    /// Every codebook begins from the latents themselves.
    fn begin(&mut self, latents_nc: &Tensor<2>) {
        self.codebooks.iter_mut().for_each(|codebook| codebook.begin(latents_nc));
    }

    fn quantize(&mut self, latents_btc: Tensor<3>) -> Quantized {
        let [n_clips, n_latents, _] = latents_btc.dims();
        let extent = Extent { n_clips, n_latents };
        let plain_btc = latents_btc.clone().detach();
        let (mut rest_btc, mut sum_btc) = (plain_btc.clone(), plain_btc.zeros_like());
        let mut loss = Tensor::zeros([1], &plain_btc.device());
        for n in 0..self.scales.len() {
            self.codebooks[n].place(&rows(plain_btc.clone()));
            let embedded = self.codebooks[n].embedded(&self.shortened(n, &rest_btc));
            let added_btc = self.added(n, embedded, extent);
            self.codebooks[n].follow(&rows(rest_btc.clone()));
            rest_btc = rest_btc - added_btc.clone().detach();
            sum_btc = sum_btc + added_btc;
            let to_codes = mean_square(latents_btc.clone(), sum_btc.clone().detach());
            loss = loss + to_codes * self.beta + mean_square(sum_btc.clone(), plain_btc.clone());
        }
        let auxiliary_loss = Some(loss * (self.commitment / self.scales.len() as f64));
        let quantized_btc = straight_through(sum_btc.detach(), latents_btc);
        Quantized { quantized_btc, auxiliary_loss }
    }

    fn ids(&self, latents_btc: Tensor<3>) -> Vec<u32> {
        let [n_clips, n_latents, _] = latents_btc.dims();
        let extent = Extent { n_clips, n_latents };
        let mut rest_btc = latents_btc;
        let scales = self.codebooks.iter().enumerate().map(|(n, codebook)| {
            let ids = codebook.codes_of(&self.shortened(n, &rest_btc));
            rest_btc = rest_btc.clone() - self.added(n, codebook.rows_of(&ids), extent);
            ids
        });
        by_clip(&scales.collect::<Vec<_>>(), n_clips)
    }

    fn lengths(&self, _: usize) -> Vec<usize> {
        self.scales.clone()
    }

    fn codebooks(&self) -> Vec<Tensor<2>> {
        self.codebooks.iter().flat_map(|codebook| codebook.codebooks()).collect()
    }

    fn sums(&self, ids: &[u32], extent: Extent) -> Vec<Tensor<3>> {
        let scales = by_scale(ids, &self.scales, extent.n_clips);
        let added =
            |(n, own): (usize, &Vec<u32>)| self.added(n, self.codebooks[n].rows_of(own), extent);
        running_sums(scales.iter().enumerate().map(added)).collect()
    }

    fn keys(&self) -> Vec<[u8; 32]> {
        self.codebooks.iter().flat_map(|codebook| codebook.keys()).collect()
    }

    fn keep(&self) -> LearnerState {
        states::keep(self.codebooks.iter().map(|codebook| &**codebook), serde_json::Value::Null)
    }

    fn resume(&mut self, saved: LoadedState) -> Option<()> {
        states::resume(self.codebooks.iter_mut().map(|codebook| &mut **codebook), saved).map(|_| ())
    }
}
