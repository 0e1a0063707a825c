//! [`GeneratorSpec`]: which generator, and its sizes. A file a kind.

mod autoregressive;
pub mod flops;
mod memory;
mod shape;

use std::ops::Deref;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use flops::{FlopsPerToken, FlopsRule};
pub use memory::TARGETS_PER_PASS;
pub use shape::{Ffn, ModelShape, ParamCounts};

use super::grid::Grid;

/// A generator, resolved: what is hashed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum GeneratorSpec {
    /// ScaMo's text-prefix transformer: each code from the codes before it.
    Autoregressive(ModelShape),
}

/// A kind of generator, as it is written in a sweep file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum GeneratorKind {
    /// ScaMo's text-prefix transformer: each code from the codes before it.
    #[default]
    Autoregressive,
}

impl GeneratorKind {
    /// The generator of this kind and shape.
    pub fn of(self, shape: ModelShape) -> GeneratorSpec {
        match self {
            Self::Autoregressive => GeneratorSpec::Autoregressive(shape),
        }
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

    /// Peak bytes that a training process has to itself.
    fn peak_bytes(&self, codes: &Grid, batch_tokens: usize) -> u64;
}

impl Deref for GeneratorSpec {
    type Target = dyn Pricing;

    fn deref(&self) -> &Self::Target {
        match self {
            Self::Autoregressive(shape) => shape,
        }
    }
}

impl GeneratorSpec {
    /// Its layers and widths, to be changed.
    pub fn shape_mut(&mut self) -> &mut ModelShape {
        match self {
            Self::Autoregressive(shape) => shape,
        }
    }
}
