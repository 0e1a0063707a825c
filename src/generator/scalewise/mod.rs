//! LG-Tok's scale-by-scale transformer (after MoSa and VAR): the codes of a scale are predicted all at
//! once, from the text, the length of the clip and the scales before.
//!
//! A sequence is `[text | scale 1 | scale 2 | …]`. The rows of scale 1 are learned; those of a later
//! scale are the sum of what the scales before it add to the tokenizer's latents, brought to its length
//! and projected. A row sees text and all rows of its own and earlier scales, and codes of one time have
//! one angle. Text stands in front, as in the autoregressive transformer; the released code reads it by
//! cross-attention.

mod batch;
mod evaluate;
mod model;
mod objective;
mod places;
mod sample;

pub use batch::{Batch, Clip};
pub use model::{Model, ScalewiseTransformer};

use super::probed::WORDS;
use super::{Kind, Sampler};
use crate::plan::RunSpec;

/// The scale-by-scale transformer as a kind of generator.
pub struct Scalewise;

impl Kind for Scalewise {
    type Network = Model;
    type Objective<'a> = objective::EachScale<'a>;

    const WANTS_SCALES: bool = true;

    fn sampler(spec: &RunSpec, model: Model) -> Box<dyn Sampler> {
        Box::new(sample::ScalewiseSampler::new(spec, model))
    }

    /// Clips as long as the longest.
    fn made_up(spec: &RunSpec, model: &Model) -> (Batch, usize) {
        let own = model.spec();
        let lengths = own.longest(&spec.codes);
        let n_codes: usize = lengths.iter().sum();
        let words = WORDS.min(own.shape.n_ctx - n_codes).max(1);
        let (text, codes) = (vec![0.5; own.shape.d_text * words], vec![0; n_codes]);
        let clip = Clip {
            text: &text,
            codes: &codes,
            inputs: lengths.iter().skip(1).map(|n| vec![0.5; n * own.d_latent]).collect(),
            lengths,
            n_latents: own.most_latents,
            supervised: 0..n_codes,
        };
        let clips = vec![clip; spec.batch_tokens.div_ceil(n_codes)];
        let batch = Batch::pack(&clips, &spec.codes, own.shape.d_text, model.places());
        (batch, clips.len() * n_codes)
    }
}
