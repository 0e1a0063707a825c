//! [`GeneratorSpec`]: which generator, and its sizes.

pub mod flops;
mod masked;
mod scalewise;

use std::ops::{Deref, Range};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use flops::{
    ClipShape, Context, Ffn, FlopsPerToken, FlopsRule, ModelShape, ParamCounts, Places, Pricing,
};
use flops::{exact_of_sequence, openai_per_token};
pub use masked::MaskedSpec;
pub use scalewise::{ScalewiseSpec, exact_of_clip};

use super::Grid;

/// A generator, resolved for hashing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum GeneratorSpec {
    /// ScaMo's text-prefix transformer: each code from the codes before it.
    Autoregressive(ModelShape),
    /// MoMask's transformers: hidden codes from visible ones, then layer by layer.
    Masked(MaskedSpec),
    /// LG-Tok's transformer: the codes of a scale all at once, given the scales before it.
    Scalewise(ScalewiseSpec),
}

/// A kind of generator, as it is written in a sweep file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum GeneratorKind {
    /// ScaMo's text-prefix transformer: each code from the codes before it.
    #[default]
    Autoregressive,
    /// MoMask's transformer: hidden codes from visible ones, and residual layers by a second transformer; needs
    /// layers of equal length. Its loss is a bound.
    Masked,
    /// LG-Tok's transformer: the codes of a scale all at once, given the scales before it; wants a
    /// quantizer of several scales.
    Scalewise,
}

impl GeneratorKind {
    /// The generator of this kind and shape, for the codes of a grid.
    pub fn of(self, shape: ModelShape, codes: &Grid, context: &Context) -> GeneratorSpec {
        match self {
            Self::Autoregressive if codes.scales.len() > 1 => {
                GeneratorSpec::Autoregressive(context.with_room(shape, codes))
            }
            Self::Autoregressive => GeneratorSpec::Autoregressive(shape),
            Self::Masked => GeneratorSpec::Masked(MaskedSpec::new(shape, context)),
            Self::Scalewise => GeneratorSpec::Scalewise(ScalewiseSpec::new(shape, codes, context)),
        }
    }

    /// The scales that it makes codes of.
    pub fn scales(self) -> Scales {
        match self {
            Self::Autoregressive => Scales::Any,
            Self::Masked => Scales::OneLength,
            Self::Scalewise => Scales::Several,
        }
    }

    /// The word in files: `autoregressive`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Autoregressive => "autoregressive",
            Self::Masked => "masked",
            Self::Scalewise => "scalewise",
        }
    }
}

/// The scales that a generator supports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scales {
    Any,
    /// One, or several of equal length.
    OneLength,
    Several,
}

impl Deref for GeneratorSpec {
    type Target = dyn Pricing;

    fn deref(&self) -> &Self::Target {
        match self {
            Self::Autoregressive(shape) => shape,
            Self::Masked(spec) => spec,
            Self::Scalewise(spec) => spec,
        }
    }
}

impl GeneratorSpec {
    /// Its layers and widths, mutable.
    pub fn shape_mut(&mut self) -> &mut ModelShape {
        match self {
            Self::Autoregressive(shape) => shape,
            Self::Masked(spec) => &mut spec.shape,
            Self::Scalewise(spec) => &mut spec.shape,
        }
    }

    /// Peak private bytes of a training process, without mapped files, which are shared.
    ///
    /// Weights, gradients, both moments and the new weights; the head's weights in panels, both ways
    /// round; what the backward pass keeps of each block for its rows (the inputs of both halves,
    /// queries, keys and values, what attention mixed and two numbers a head, the columns before the
    /// activation); one block's for the rows that are measured together; a few rows' logits.
    ///
    /// Measured on 15 runs of widths 8 to 256, 64 to 4096 codes and batches of 64 to 1024: 28 to 265 MB; the prediction is
    /// 0.94 to 1.29 of that (docs/performance.md).
    pub fn peak_bytes(&self, codes: &Grid, batch_tokens: usize) -> u64 {
        let (shape, params, n_vocab) = (self.shape(), self.params(codes), codes.n_vocab() as f64);
        let (d, targets) = (shape.d_model as f64, batch_tokens as f64);
        let before = match shape.ffn {
            Ffn::SwiGlu => 2.0 * shape.d_ff as f64,
            Ffn::Gelu => shape.d_ff as f64,
        };
        let block = 6.0 * d + before + 2.0 * shape.n_head as f64;
        let kept = shape.n_layer as f64 * block + 4.0 * d;
        let trained = ROUNDED * POSITIONS_PER_TARGET * targets * kept;
        let measured = ROUNDED_MEASURED * POSITIONS_PER_TARGET * TARGETS_PER_PASS as f64 * block;
        let head = 2.0 * d * n_vocab + targets.min(HEAD_ROWS) * n_vocab;
        let parameters = FLOATS_PER_PARAMETER * params.total() as f64;
        (BASE_BYTES + 4.0 * (trained + measured + head + parameters)) as u64
    }
}

// Memory of a run.

/// Targets a forward pass of evaluation at most, but for a single clip.
pub const TARGETS_PER_PASS: usize = 2048;

/// Memory of a worker's runtime without a model.
const BASE_BYTES: f64 = 26e6;

/// Positions trained or measured for each target: prefixes come on top.
const POSITIONS_PER_TARGET: f64 = 1.8;

/// Overhead of rounding up allocations: of tensors kept for the backward pass, and of temporary ones while a split is
/// measured.
const ROUNDED: f64 = 1.1;
const ROUNDED_MEASURED: f64 = 1.5;

/// Floats for each parameter: weights, gradients, both moments, the new weights, and panels.
const FLOATS_PER_PARAMETER: f64 = 5.5;

/// Rows of which the head holds the logits at once.
const HEAD_ROWS: f64 = 256.0;

// Cost of the text-prefix transformer.

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
            six_nd: self.params(codes).six_nd_per_token(),
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
