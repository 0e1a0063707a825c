//! [`Codebook`]: the codes of one scale of a multi-scale quantizer.
//!
//! Shapes: n latents, c channels.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::{Fsq, Quantizer, Vq};
use crate::spec::{CodebookSpec, TokenizerTraining};
use crate::tokenizer::architecture::stands_for;

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
                let mut vq = Vq::new(*n_vocab, code_dim, training, rng, device);
                vq.cosine = cosine;
                Self::Vq(vq)
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

stands_for!(Codebook, Quantizer: Fsq, Vq);
