//! [`GeneratorSpec`]: which generator, and its sizes. A file a kind.

mod autoregressive;
pub mod flops;
mod masked;
mod memory;
mod pricing;
mod scalewise;
mod shape;
mod two_stages;

use std::ops::Deref;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use flops::{FlopsPerToken, FlopsRule};
pub use masked::MaskedSpec;
pub use memory::TARGETS_PER_PASS;
pub use pricing::{ClipShape, Context, Places, Pricing};
pub use scalewise::{ScalewiseSpec, exact_of_clip};
pub use shape::{Ffn, ModelShape, ParamCounts};

use super::grid::Grid;

/// A generator, resolved: what is hashed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum GeneratorSpec {
    /// ScaMo's text-prefix transformer: each code from the codes before it.
    Autoregressive(ModelShape),
    /// MoMask's transformers: hidden codes from those that are not, then layer after layer.
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
    /// MoMask's transformer: hidden codes from those that are not, and residual layers by a second
    /// transformer; wants codes of one length. Its loss is a bound.
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

/// Of how many scales a generator makes codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scales {
    Any,
    /// Of one, or of several that are equally long.
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
    /// Its layers and widths, to be changed.
    pub fn shape_mut(&mut self) -> &mut ModelShape {
        match self {
            Self::Autoregressive(shape) => shape,
            Self::Masked(spec) => &mut spec.shape,
            Self::Scalewise(spec) => &mut spec.shape,
        }
    }
}
