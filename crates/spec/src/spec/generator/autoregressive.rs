//! What the text-prefix transformer takes.

use std::ops::Range;

use super::flops::{FlopsPerToken, exact_of_sequence, openai_per_token, six_nd_per_token};
use super::pricing::{ClipShape, Pricing};
use super::shape::{ModelShape, ParamCounts};
use crate::spec::grid::Grid;

impl Pricing for ModelShape {
    fn name(&self) -> &'static str {
        "autoregressive"
    }

    fn shape(&self) -> &ModelShape {
        self
    }

    fn params(&self, codes: &Grid) -> ParamCounts {
        self.params_of(codes.n_vocab())
    }

    /// The exact count is at full context: a prefix of the longest text and every motion slot but the
    /// spare one.
    fn flops_per_token(&self, codes: &Grid, prefix: usize) -> FlopsPerToken {
        let (n_vocab, targets) = (codes.n_vocab(), (self.n_ctx - prefix - 1) as f64);
        FlopsPerToken {
            openai: openai_per_token(self, n_vocab),
            six_nd: six_nd_per_token(self, n_vocab),
            exact: exact_of_sequence(self, n_vocab, prefix as f64, targets) / targets,
        }
    }

    /// Positions after the last supervised target are left out.
    fn exact_of_part(&self, codes: &Grid, clip: ClipShape, supervised: Range<usize>) -> f64 {
        let (prefix, n_vocab, end) = (clip.n_text as f64, codes.n_vocab(), supervised.end as f64);
        let head = 2.0 * (self.d_model * (n_vocab + 1)) as f64;
        exact_of_sequence(self, n_vocab, prefix, end) - supervised.start as f64 * head
    }
}
