//! MoMask's masked transformer: hidden codes are predicted from the text and the codes that are not
//! hidden; motions are made in a few rounds, the surest codes first. Codes of several layers have a
//! second transformer ([`residual`]).
//!
//! The network is the autoregressive transformer's, parameter for parameter, so that the two differ in
//! what they are asked alone. MoMask's own has post-norm, biases and sinusoidal positions, and the
//! sentence as one token in front.

mod batch;
mod evaluate;
mod flops;
mod objective;
pub mod residual;
mod sample;
mod shown;

use batch::hidden_clip;
pub use batch::{Hidden, pack};

use super::autoregressive::{Batch, Model, probed_tokens};
use super::probed::made_up_clip;
use super::{Kind, Sampler};
use crate::plan::RunSpec;

/// The masked transformer of one codebook as a kind of generator.
pub struct Masked;

impl Kind for Masked {
    type Network = Model;
    type Objective<'a> = objective::HiddenCodes<'a>;

    fn sampler(spec: &RunSpec, model: Model) -> Box<dyn Sampler> {
        Box::new(sample::MaskedSampler::new(spec, model, None))
    }

    fn made_up(spec: &RunSpec, model: &Model) -> (Batch, usize) {
        let (text, codes) = made_up_clip(model.shape(), spec.n_vocab());
        let n_clips = probed_tokens(spec).div_ceil(codes.len());
        let clips = vec![hidden_clip(&text, &codes, spec.n_vocab()); n_clips];
        (pack(&clips, model.shape().d_text), n_clips * codes.len())
    }
}
