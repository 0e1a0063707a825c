//! The multi-scale quantizer of LG-Tok, after VAR (Tian et al. 2024): residual quantization in which layer n has the clip
//! at s_n latents, whatever its length.
//!
//! For the latents z (t of them) and the scales s_1 < … < s_K, each with its own codebook:
//!
//! ids_n = nearest(area_down(r_n, s_n)), h_n = φ_n(linear_up(codes of ids_n, t)),
//! r_{n+1} = r_n − h_n, r_1 = z, ẑ_n = Σ_{j≤n} h_j,
//!
//! and the decoder gets ẑ_K with the gradient passed straight through to z. The loss is
//!
//! commitment · mean_n [β · mean (sg(ẑ_n) − z)² + mean (ẑ_n − sg(z))²];
//!
//! only its second term trains φ and, for FSQ codebooks, their projections. A VQ codebook moves towards the latents that
//! take its codes among the t of r_n, not among the s_n that were looked up (as in LG-Tok's code). Its codes start as
//! latents z.
//!
//! Shapes: b clips, t latents, c channels, s codes of a clip on a scale.

use burn::module::Module;
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use super::{
    Extent, Fsq, Quantized, Quantizer, Vq, area_down, by_clip, by_scale, clips, keep_parts,
    linear_up, mean_square, resume_parts, rows, running_sums, straight_through,
};
use crate::learn::layers::Conv1d;
use crate::learn::{LearnerState, LoadedState};
use crate::spec::{CodebookSpec, MultiscaleSpec, TokenizerTraining};
use crate::tokenizer::halves::stands_for;

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
        let mut codebook = |own| Codebook::new(own, spec.cosine, code_dim, training, rng, device);
        Self {
            codebooks: spec.codebooks.iter().map(&mut codebook).collect(),
            smoothings: (0..spec.scales.len())
                .map(|_| Smoothing::new(spec.mix, code_dim, rng, device))
                .collect(),
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
        keep_parts(self.codebooks.iter().map(|codebook| &**codebook), Value::Null)
    }

    fn resume(&mut self, saved: LoadedState) -> Option<()> {
        resume_parts(self.codebooks.iter_mut().map(|codebook| &mut **codebook), saved).map(|_| ())
    }
}

// The codes of one scale.

/// A codebook of either kind.
#[derive(Module, Debug)]
enum Codebook {
    Fsq(Fsq),
    Vq(Vq),
}

impl Codebook {
    /// A fresh codebook; `cosine` has VQ compare directions.
    fn new(
        spec: &CodebookSpec,
        cosine: bool,
        code_dim: usize,
        training: &TokenizerTraining,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        match spec {
            CodebookSpec::Fsq { levels } => Self::Fsq(Fsq::new(levels, code_dim, rng, device)),
            CodebookSpec::Vq { n_vocab } => {
                let mut vq = Vq::new(*n_vocab, code_dim, training, rng, device);
                vq.cosine = cosine;
                Self::Vq(vq)
            }
        }
    }

    /// Places VQ's codes at the first latents of a batch, unless they have been placed.
    fn place(&mut self, latents_nc: &Tensor<2>) {
        if let Self::Vq(vq) = self {
            vq.place(latents_nc);
        }
    }

    /// The code of each latent.
    fn codes_of(&self, latents_nc: &Tensor<2>) -> Vec<u32> {
        match self {
            Self::Fsq(fsq) => fsq.codes_of(latents_nc.clone()),
            Self::Vq(vq) => vq.codes_of(latents_nc),
        }
    }

    /// The embedding of each code, `[n, c]`.
    fn rows_of(&self, ids: &[u32]) -> Tensor<2> {
        match self {
            Self::Fsq(fsq) => fsq.rows_of(ids),
            Self::Vq(vq) => vq.rows_of(ids),
        }
    }

    /// The embedding of each latent's code, `[n, c]`, with a gradient to FSQ's projections.
    fn embedded(&self, latents_nc: &Tensor<2>) -> Tensor<2> {
        match self {
            Self::Fsq(fsq) => fsq.embedded(latents_nc.clone()),
            Self::Vq(vq) => vq.rows_of(&vq.codes_of(latents_nc)),
        }
    }

    /// Moves VQ's codes after a batch of latents, each with the code that it takes.
    fn follow(&mut self, latents_nc: &Tensor<2>) {
        if let Self::Vq(vq) = self {
            let ids = vq.codes_of(latents_nc);
            vq.follow(latents_nc, &ids);
        }
    }
}

stands_for!(Codebook, Quantizer: Fsq, Vq);

// The transformation φ of a scale's codes.

/// φ(h) = relu(conv₃(relu(conv₃(h)))), as in LG-Tok's code, which is never negative; or with VAR's residual mix m (Tian
/// et al. 2024) φ(h) = (1 − m)·h + m·conv₃(h).
#[derive(Module, Debug)]
struct Smoothing {
    convolutions: Vec<Conv1d>,
    #[module(skip)]
    mix: Option<f64>,
}

impl Smoothing {
    /// φ for `code_dim` channels, drawn as PyTorch draws convolutions.
    fn new(mix: Option<f64>, code_dim: usize, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        let mut convolution = || Conv1d::same([code_dim; 2], 1, rng, device);
        let convolutions = match mix {
            None => vec![convolution(), convolution().rectified()],
            Some(_) => vec![convolution()],
        };
        Self { convolutions, mix }
    }

    /// `[b, t, c]` to the same.
    fn forward(&self, x_btc: Tensor<3>) -> Tensor<3> {
        let y_btc = self.convolutions.iter().fold(x_btc.clone(), |x, conv| conv.forward(x));
        match self.mix {
            None => relu(y_btc),
            Some(mix) => x_btc * (1.0 - mix) + y_btc * mix,
        }
    }
}
