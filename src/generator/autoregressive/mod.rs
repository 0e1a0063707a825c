//! ScaMo's text-prefix autoregressive transformer: model, batches, training, loss, sampling.
//!
//! Codes of several scales are one sequence, scale after scale, and the codebooks one vocabulary: V is
//! the sum of theirs. Such clips have no end token, since the lengths of the scales tell where they end;
//! its row and its logit stand unused, so that a model has the same shape for every grid.

mod batch;
mod decode;
mod evaluate;
mod objective;
mod sample;
mod stream;
mod transformer;

pub use batch::{Batch, Sequence};
pub use evaluate::split_loss;
pub use stream::{Part, TokenStream};
pub use transformer::{Model, Transformer, end_token};

use super::probed::{MOST_TOKENS, made_up_clip};
use super::{Kind, Sampler};
use crate::plan::RunSpec;

/// Logits of a measured step, at most.
const MOST_LOGITS: usize = 1 << 24;

/// Tokens of a measured step, a few more apart.
pub fn probed_tokens(spec: &RunSpec) -> usize {
    spec.batch_tokens.min(MOST_TOKENS).min(MOST_LOGITS / spec.n_vocab())
}

/// The text-prefix autoregressive transformer as a kind of generator.
pub struct Autoregressive;

impl Kind for Autoregressive {
    type Network = Model;
    type Objective<'a> = objective::NextCode<'a>;

    fn sampler(spec: &RunSpec, model: Model) -> Box<dyn Sampler> {
        Box::new(sample::AutoregressiveSampler { model, grid: spec.codes.clone() })
    }

    fn made_up(spec: &RunSpec, model: &Model) -> (Batch, usize) {
        let (shape, n_vocab) = (model.shape(), spec.n_vocab());
        let (text, codes) = made_up_clip(shape, n_vocab);
        let to = codes.len() + 1;
        let clips = probed_tokens(spec).div_ceil(to);
        let sequence = Sequence { text: &text, codes: &codes, from: 0, to };
        let batch = Batch::pack(&vec![sequence; clips], shape.d_text, end_token(n_vocab));
        (batch, clips * to)
    }
}
