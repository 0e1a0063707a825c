//! The names of methods and flags, as `laws.json` and messages write them.

use super::{Laws, MinimumFlag, Parameters, PowerLaw, PowerLaws};
use crate::laws::MinimumMethod;
use std::fmt;

impl fmt::Display for MinimumMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Argmin => "argmin",
            Self::Parabola => "parabola",
            Self::Cubic => "cubic",
            Self::Akima => "akima",
            Self::Surface => "surface",
        })
    }
}

impl fmt::Display for MinimumFlag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::NotBracketed => "not-bracketed",
            Self::NotConvex => "not-convex",
            Self::WeakCurvature => "weak-curvature",
            Self::FewLevels => "few-levels",
            Self::VocabNotBracketed => "vocab-not-bracketed",
            Self::EdgeVocab => "edge-vocab",
            Self::LackOfFit => "lack-of-fit",
            Self::BelowRuns => "below-runs",
            Self::Gap => "gap",
            Self::DepthChange => "depth-change",
        })
    }
}

impl Parameters {
    /// The symbol of a model's size.
    pub fn size(self) -> &'static str {
        match self {
            Self::Split => "N_nv",
            Self::Total => "N",
        }
    }
}

/// The laws in C with the symbols of what they are laws of.
pub(super) fn law_name(laws: &Laws) -> Vec<(&'static str, &PowerLaw)> {
    let PowerLaws { params, params_nonvocab, params_vocab, tokens } = &laws.power_laws;
    let named = [("N", params), ("N_nv", params_nonvocab), ("N_v", params_vocab), ("D", tokens)];
    named.into_iter().filter_map(|(name, law)| Some((name, law.as_ref()?))).collect()
}

/// The flags in one phrase: "not-convex, vocab-edge".
pub fn flags_text(flags: &[MinimumFlag]) -> String {
    flags.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}
