//! What is made of the runs: the `flops`, `fit` and `predict` sections.

use serde::{Deserialize, Serialize};

use crate::units::number;

/// Which count of FLOPs a budget is spent in and the laws are written in.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize,
)]
pub enum FlopsRule {
    /// ScaMo Code 1, after Kaplan et al. 2020.
    #[default]
    #[serde(rename = "openai")]
    OpenAi,
    /// 6 (N_nv + N_v) D, ScaMo Eq. 7.
    #[serde(rename = "6nd")]
    SixNd,
    /// The multiply-adds of the model as built.
    #[serde(rename = "exact")]
    Exact,
}

impl FlopsRule {
    /// Every rule.
    pub const ALL: [Self; 3] = [Self::OpenAi, Self::SixNd, Self::Exact];

    /// The name in files: `openai`, `6nd`, `exact`.
    pub fn name(self) -> &'static str {
        match self {
            FlopsRule::OpenAi => "openai",
            FlopsRule::SixNd => "6nd",
            FlopsRule::Exact => "exact",
        }
    }
}

/// The `flops` section.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FlopsSpec {
    pub rule: FlopsRule,
}

/// How the minimum of one budget was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MinimumMethod {
    /// The best run (ScaMo).
    Argmin,
    /// A quadratic in ln N_nv through the best run of each size (Hoffmann et al. 2022, approach 2).
    Parabola,
    /// A cubic in ln N_nv, the parabola's check.
    Cubic,
    /// Akima's local spline in ln N_nv, which no far-off size can bend.
    Akima,
    /// A joint quadratic in (ln N_nv, ln N_v).
    Surface,
}

/// Which budget takes no part in the fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HoldOutSpec {
    #[default]
    LargestBudget,
    None,
}

/// The `fit` section.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FitSpec {
    pub minima: Vec<MinimumMethod>,
    pub hold_out: HoldOutSpec,
    /// Bootstrap replicates for the intervals.
    #[serde(deserialize_with = "number::count")]
    pub bootstrap: usize,
}

impl Default for FitSpec {
    fn default() -> Self {
        use MinimumMethod::{Argmin, Cubic, Parabola, Surface};
        Self {
            minima: vec![Parabola, Argmin, Cubic, Surface],
            hold_out: HoldOutSpec::default(),
            bootstrap: 1000,
        }
    }
}

/// The `predict` section.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PredictSpec {
    #[serde(deserialize_with = "number::numbers")]
    pub budgets: Vec<f64>,
}
