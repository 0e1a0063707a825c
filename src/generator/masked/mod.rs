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

use std::f64::consts::FRAC_2_PI;

pub use batch::{Hidden, pack};

use super::autoregressive::{Batch, Model, end_token, probed_tokens};
use super::probed::made_up_clip;
use super::{Kind, Sampler};
use crate::plan::RunSpec;
use crate::spec::{GeneratorSpec, MaskedSpec};

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

/// A clip of which as many codes are hidden as in the mean of training: the mean of cos(π u / 2).
fn hidden_clip<'a>(text: &'a [f32], codes: &[u32], n_vocab: usize) -> Hidden<'a> {
    let n_hidden = (FRAC_2_PI * codes.len() as f64).ceil() as usize;
    let mut shown = codes.to_vec();
    shown[..n_hidden].fill(end_token(n_vocab));
    Hidden { text, shown, targets: codes[..n_hidden].iter().copied().enumerate().collect() }
}

/// The description of a run's generator, which is of this kind.
fn own(spec: &RunSpec) -> &MaskedSpec {
    match &spec.generator {
        GeneratorSpec::Masked(own) => own,
        other => unreachable!("a {} generator", other.name()),
    }
}
