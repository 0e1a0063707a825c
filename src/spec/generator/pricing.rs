//! [`Pricing`]: what a generator takes, and [`Context`]: what surrounds it.

use super::flops::FlopsPerToken;
use super::shape::{ModelShape, ParamCounts};
use crate::spec::grid::Grid;

/// What surrounds a generator, of which its kind takes what it needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Context {
    /// Tokens of the longest text.
    pub max_text: usize,
    /// Channels of the tokenizer's latents.
    pub d_latent: usize,
    /// Frames that one of these stands for.
    pub frames_per_latent: usize,
    /// Share of the codes that training shows as random ones.
    pub corruption: f64,
    /// Share of the captions that training leaves out.
    pub text_drop: f64,
}

impl Context {
    /// Latents of the longest clip: the motion slots of a shape.
    pub fn most_latents(&self, shape: &ModelShape) -> usize {
        shape.n_ctx - self.max_text
    }

    /// A shape with room for the longest text and every code of the longest clip, in place of one for
    /// its latents.
    pub fn with_room(&self, shape: ModelShape, codes: &Grid) -> ModelShape {
        let longest_clip = self.most_latents(&shape) * self.frames_per_latent;
        ModelShape { n_ctx: self.max_text + codes.n_codes(longest_clip), ..shape }
    }
}

/// What a generator takes, before it is built.
pub trait Pricing {
    /// The word in files: `autoregressive`.
    fn name(&self) -> &'static str;

    /// Its layers and widths.
    fn shape(&self) -> &ModelShape;

    /// Its parameters by group, for the codes of a grid.
    fn params(&self, codes: &Grid) -> ParamCounts;

    /// Forward FLOPs a supervised token by every convention, after a text of `prefix` tokens.
    fn flops_per_token(&self, codes: &Grid, prefix: usize) -> FlopsPerToken;

    /// Positions that the codes of a clip of so many frames take in a sequence, after its text.
    fn positions(&self, codes: &Grid, n_frames: usize) -> usize {
        codes.n_codes(n_frames)
    }

    /// Peak bytes that a training process has to itself.
    fn peak_bytes(&self, codes: &Grid, batch_tokens: usize) -> u64;
}
