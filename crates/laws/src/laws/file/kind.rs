//! [`LawKind`]: how laws were come by.

use serde::{Deserialize, Serialize};

use crate::laws::input::point::Parameters;
use crate::laws::parametric::form::Form;

/// How laws were come by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LawKind {
    /// Through the minima of IsoFLOP budgets (Hoffmann et al. 2022, approach 2; ScaMo).
    #[default]
    Isoflop,
    /// Through the running minimum of the loss (approach 1).
    Approach1,
    /// Taken from a paper.
    Published,
    /// By a parametric loss: `approach3`, `approach3-vocab`.
    #[serde(untagged)]
    Parametric(Form),
}

impl LawKind {
    /// Every kind that can be fitted.
    pub fn fitted() -> impl Iterator<Item = Self> {
        [Self::Isoflop, Self::Approach1].into_iter().chain(Form::ALL.map(Self::Parametric))
    }

    /// The name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Isoflop => "isoflop",
            Self::Approach1 => "approach1",
            Self::Published => "published",
            Self::Parametric(form) => form.name(),
        }
    }

    /// A line for the help.
    pub fn about(self) -> &'static str {
        match self {
            Self::Isoflop => "Minima of each budget, power laws through them, loss laws",
            Self::Approach1 => "Power laws through the running minimum of the loss",
            Self::Published => "Taken from a paper",
            Self::Parametric(form) => form.equation(),
        }
    }

    /// Whether its power laws hold around one budget alone.
    pub fn bends(self) -> bool {
        matches!(self, Self::Parametric(form) if form.parameters() == Parameters::Split)
    }
}
