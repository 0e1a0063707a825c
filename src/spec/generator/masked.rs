//! What the masked transformer takes.

use serde::{Deserialize, Serialize};

use super::flops::{FlopsPerToken, exact_whole, openai_per_token, six_nd_per_token};
use super::memory::peak_bytes;
use super::pricing::{Context, Pricing};
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

    /// Both stages see a code a place.
    fn positions(&self, codes: &Grid, n_frames: usize) -> usize {
        codes.lengths(n_frames).next().unwrap_or(0)
    }

    fn peak_bytes(&self, codes: &Grid, batch_tokens: usize) -> u64 {
        peak_bytes(&self.shape, codes.n_vocab(), self.params(codes), batch_tokens)
    }
}
