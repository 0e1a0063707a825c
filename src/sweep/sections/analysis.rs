//! What is made of the runs: the `flops`, `fit` and `predict` sections.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::laws::MinimumMethod::{self, Argmin, Cubic, Parabola, Surface};
use crate::spec::FlopsRule;
use crate::units::section;

section! {
    /// The `flops` section: how FLOPs are counted.
    pub struct FlopsSection {
        rule: FlopsRule = FlopsRule::default();
    }
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

section! {
    /// The `fit` section: how laws are fitted to the runs.
    pub struct FitSection {
        /// How the minimum of each budget is found: the laws go through the parabolas, or through the
        /// best runs where too few parabolas can be trusted, and the others stand beside them.
        minima: Vec<MinimumMethod> = vec![Parabola, Argmin, Cubic, Surface];
        hold_out: HoldOutSpec = HoldOutSpec::default();
        /// Bootstrap replicates for the intervals.
        bootstrap: usize = 1000;
    }
}

section! {
    /// The `predict` section: what the laws are asked at the end.
    pub struct PredictSection {
        /// Budgets, in FLOPs, of which the best configuration is given.
        budgets: Vec<f64> = Vec::new();
    }
}
