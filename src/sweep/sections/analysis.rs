//! What is made of the runs: the `flops`, `fit` and `predict` sections.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::laws::MinimumMethod;

use crate::spec::FlopsRule;
use crate::units::number;

/// The `flops` section: how FLOPs are counted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FlopsSection {
    pub rule: FlopsRule,
}

/// Which budget takes no part in the fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum HoldOutSpec {
    /// The largest. The laws of the others are tested on it.
    #[default]
    LargestBudget,
    /// All are fitted, and none is left to test the laws on.
    None,
}

/// The `fit` section: how laws are fitted to the runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FitSection {
    /// How the minimum of each budget is found: the laws go through the parabolas, or through the
    /// best runs where too few parabolas can be trusted, and the others stand beside them.
    pub minima: Vec<MinimumMethod>,
    pub hold_out: HoldOutSpec,
    /// Bootstrap replicates for the intervals.
    #[serde(deserialize_with = "number::count")]
    pub bootstrap: usize,
}

impl Default for FitSection {
    fn default() -> Self {
        use MinimumMethod::{Argmin, Cubic, Parabola, Surface};
        Self {
            minima: vec![Parabola, Argmin, Cubic, Surface],
            hold_out: HoldOutSpec::default(),
            bootstrap: 1000,
        }
    }
}

/// The `predict` section: what the laws are asked at the end.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PredictSection {
    /// Budgets, in FLOPs, of which the best configuration is given.
    #[serde(deserialize_with = "number::numbers")]
    pub budgets: Vec<f64>,
}
