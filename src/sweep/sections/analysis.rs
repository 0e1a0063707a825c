//! What is made of the runs: the `flops`, `fit` and `predict` sections.

use serde::{Deserialize, Serialize};

use crate::spec::FlopsRule;
use crate::units::number;

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
