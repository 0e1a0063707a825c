//! [`Pricing`]: what a generator takes, and [`Context`]: what surrounds it.

use std::ops::Range;

use super::flops::FlopsPerToken;
use super::memory::peak_bytes;
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

/// A training clip as a price sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ClipShape {
    pub n_frames: usize,
    /// Tokens of its text.
    pub n_text: usize,
}

impl ClipShape {
    /// A mean over runs that leave out a share of the captions, as one token.
    pub fn mean_over_texts(self, text_drop: f64, of: impl Fn(usize) -> f64) -> f64 {
        (1.0 - text_drop) * of(self.n_text) + text_drop * of(1)
    }
}

/// What steps count of a clip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Places {
    pub count: usize,
    /// Supervised tokens that each of them is.
    pub tokens_each: usize,
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

    /// What steps count of a clip of so many frames: its targets.
    fn places(&self, codes: &Grid, n_frames: usize) -> Places {
        Places { count: codes.n_targets(n_frames), tokens_each: 1 }
    }

    /// Forward FLOPs by the exact count of a clip in a step that supervises some of its places: every
    /// position that goes through the network, and the heads of what is supervised. On the mean over
    /// what training draws.
    fn exact_of_part(&self, codes: &Grid, clip: ClipShape, supervised: Range<usize>) -> f64;

    /// Positions that the codes of a clip of so many frames take in a sequence, after its text.
    fn positions(&self, codes: &Grid, n_frames: usize) -> usize {
        codes.n_codes(n_frames)
    }

    /// Peak bytes that a training process has to itself.
    fn peak_bytes(&self, codes: &Grid, batch_tokens: usize) -> u64 {
        peak_bytes(self.shape(), codes.n_vocab(), self.params(codes), batch_tokens)
    }
}
