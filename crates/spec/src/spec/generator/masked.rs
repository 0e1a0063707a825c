//! What the masked transformer takes.

use std::f64::consts::FRAC_PI_2;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::flops::{FlopsPerToken, exact_whole, openai_per_token, six_nd_per_token};
use super::pricing::{ClipShape, Context, Places, Pricing};
use super::shape::{ModelShape, ParamCounts};
use super::two_stages;
use crate::spec::grid::Grid;

/// MoMask's generator, resolved: hidden codes from the text and the codes that are not hidden. It is
/// the autoregressive transformer, parameter for parameter, in which every position sees every other;
/// the row of the end token's embedding stands for a hidden code.
///
/// Codes of several layers, equally long, have a second transformer of the same shape, which makes the
/// codes of a layer all at once from those of the layers before it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MaskedSpec {
    pub shape: ModelShape,
    /// Share of the hidden codes that training shows as random ones.
    pub corruption: f64,
    /// Share of the captions that training leaves out.
    pub text_drop: f64,
}

impl MaskedSpec {
    /// The generator of a shape.
    pub fn new(shape: ModelShape, context: &Context) -> Self {
        Self { shape, corruption: context.corruption, text_drop: context.text_drop }
    }
}

/// Points at which the share that is hidden is looked at.
const SHARES: usize = 8;

/// How many of `asked` codes of a clip of `n` are hidden, on the mean, where the share cos(π u / 2) of the
/// clip is, u drawn from 0 to 1, and one of those asked at least.
fn mean_hidden(n: usize, asked: usize) -> f64 {
    let at = |i: usize| {
        let share = (FRAC_PI_2 * (i as f64 + 0.5) / SHARES as f64).cos();
        let share = (share * n as f64).round().clamp(1.0, n as f64) / n as f64;
        share * asked as f64 + (1.0 - share).powi(asked as i32)
    };
    (0..SHARES).map(at).sum::<f64>() / SHARES as f64
}

/// Whether a masked generator of such codes has a second stage.
fn has_second_stage(codes: &Grid) -> bool {
    codes.scales.len() > 1
}

impl Pricing for MaskedSpec {
    fn name(&self) -> &'static str {
        "masked"
    }

    fn shape(&self) -> &ModelShape {
        &self.shape
    }

    fn params(&self, codes: &Grid) -> ParamCounts {
        match has_second_stage(codes) {
            true => two_stages::params(&self.shape, codes),
            false => self.shape.params_of(codes.n_vocab()),
        }
    }

    /// A token is a code that goes through the network, hidden or not. By the OpenAI rule it costs what
    /// it costs in the autoregressive transformer; the exact count is at full context, with a head for
    /// every code.
    fn flops_per_token(&self, codes: &Grid, prefix: usize) -> FlopsPerToken {
        if has_second_stage(codes) {
            return two_stages::flops_per_token(&self.shape, codes, prefix);
        }
        let (shape, n_vocab) = (&self.shape, codes.n_vocab());
        let n_codes = shape.n_ctx - prefix - 1;
        FlopsPerToken {
            openai: openai_per_token(shape, n_vocab),
            six_nd: six_nd_per_token(shape, n_vocab),
            exact: exact_whole(shape, n_vocab, prefix, n_codes, n_codes) / n_codes as f64,
        }
    }

    /// Codes of the first scale; with a second stage each is two tokens.
    fn places(&self, codes: &Grid, n_frames: usize) -> Places {
        let tokens_each = if has_second_stage(codes) { 2 } else { 1 };
        Places { count: self.positions(codes, n_frames), tokens_each }
    }

    /// Every stage sees the whole clip; the first has a head for what is hidden.
    fn exact_of_part(&self, codes: &Grid, clip: ClipShape, supervised: Range<usize>) -> f64 {
        let (shape, n) = (&self.shape, self.positions(codes, clip.n_frames));
        let blocks = |prefix| exact_whole(shape, 0, prefix, n, 0);
        let hidden = mean_hidden(n, supervised.len());
        let first = hidden * (codes.scales[0].n_vocab + 1) as f64;
        let mut heads = first;
        let mut stages = 1.0;
        if has_second_stage(codes) {
            heads += supervised.len() as f64 * two_stages::mean_later_vocab(codes);
            stages = 2.0;
        }
        stages * clip.mean_over_texts(self.text_drop, blocks) + 2.0 * shape.d_model as f64 * heads
    }

    /// Both stages see a code a place.
    fn positions(&self, codes: &Grid, n_frames: usize) -> usize {
        codes.lengths(n_frames).next().unwrap_or(0)
    }
}
