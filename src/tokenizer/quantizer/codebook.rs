//! [`Codebook`]: the codes of one scale of a multi-scale quantizer.
//!
//! Shapes: n latents, c channels.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::{Extent, Fsq, Quantized, Quantizer, Vq};
use crate::learn::{LearnerState, LoadedState};
use crate::spec::{CodebookSpec, TokenizerTraining};

/// A codebook of either kind.
#[derive(Module, Debug)]
pub enum Codebook {
    Fsq(Fsq),
    Vq(Vq),
}

impl Codebook {
    /// A fresh codebook; `cosine` has VQ compare directions.
    pub fn new(
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
                let vq = Vq::new(*n_vocab, code_dim, training, rng, device);
                Self::Vq(vq.comparing_directions(cosine))
            }
        }
    }

    /// Places VQ's codes at the first latents of a batch, unless they have been placed.
    pub fn place(&mut self, latents_nc: &Tensor<2>) {
        if let Self::Vq(vq) = self {
            vq.place(latents_nc);
        }
    }

    /// The code of each latent.
    pub fn codes_of(&self, latents_nc: &Tensor<2>) -> Vec<u32> {
        match self {
            Self::Fsq(fsq) => fsq.codes_of(latents_nc.clone()),
            Self::Vq(vq) => vq.codes_of(latents_nc),
        }
    }

    /// The embedding of each code, `[n, c]`.
    pub fn rows_of(&self, ids: &[u32]) -> Tensor<2> {
        match self {
            Self::Fsq(fsq) => fsq.rows_of(ids),
            Self::Vq(vq) => vq.rows_of(ids),
        }
    }

    /// The embedding of each latent's code, `[n, c]`, with a gradient to FSQ's projections.
    pub fn embedded(&self, latents_nc: &Tensor<2>) -> Tensor<2> {
        match self {
            Self::Fsq(fsq) => fsq.embedded(latents_nc.clone()),
            Self::Vq(vq) => vq.rows_of(&vq.codes_of(latents_nc)),
        }
    }

    /// Moves VQ's codes after a batch of latents, each with the code that it takes.
    pub fn follow(&mut self, latents_nc: &Tensor<2>) {
        if let Self::Vq(vq) = self {
            let ids = vq.codes_of(latents_nc);
            vq.follow(latents_nc, &ids);
        }
    }
}

impl Quantizer for Codebook {
    fn begin(&mut self, latents_nc: &Tensor<2>) {
        match self {
            Self::Fsq(fsq) => fsq.begin(latents_nc),
            Self::Vq(vq) => vq.begin(latents_nc),
        }
    }

    fn quantize(&mut self, latents_btc: Tensor<3>) -> Quantized {
        match self {
            Self::Fsq(fsq) => fsq.quantize(latents_btc),
            Self::Vq(vq) => vq.quantize(latents_btc),
        }
    }

    fn ids(&self, latents_btc: Tensor<3>) -> Vec<u32> {
        match self {
            Self::Fsq(fsq) => fsq.ids(latents_btc),
            Self::Vq(vq) => vq.ids(latents_btc),
        }
    }

    fn codebooks(&self) -> Vec<Tensor<2>> {
        match self {
            Self::Fsq(fsq) => fsq.codebooks(),
            Self::Vq(vq) => vq.codebooks(),
        }
    }

    fn sums(&self, ids: &[u32], extent: Extent) -> Vec<Tensor<3>> {
        match self {
            Self::Fsq(fsq) => fsq.sums(ids, extent),
            Self::Vq(vq) => vq.sums(ids, extent),
        }
    }

    fn keys(&self) -> Vec<[u8; 32]> {
        match self {
            Self::Fsq(fsq) => fsq.keys(),
            Self::Vq(vq) => vq.keys(),
        }
    }

    fn keep(&self) -> LearnerState {
        match self {
            Self::Fsq(fsq) => fsq.keep(),
            Self::Vq(vq) => vq.keep(),
        }
    }

    fn resume(&mut self, saved: LoadedState) -> Option<()> {
        match self {
            Self::Fsq(fsq) => fsq.resume(saved),
            Self::Vq(vq) => vq.resume(saved),
        }
    }
}
