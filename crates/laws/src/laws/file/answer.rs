//! [`Answer`]: what a fit says, once, for screen, figures, report, notebook and files.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::laws::input::method::MinimumMethod;
use crate::laws::input::quantities::PerQuantity;

/// What a fit says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// The law that everything below is of: `joint`, `floor`, `approach3`, …
    pub law: String,
    /// The minima that the law goes through; absent where it goes through the cells themselves.
    pub method: Option<MinimumMethod>,
    /// Why this law.
    pub why: String,
    /// The loss, with numbers.
    pub formula: String,
    pub coefficients: BTreeMap<String, Coefficient>,
    /// `nats`, or `as given` in a table of another's.
    pub loss_unit: String,
    /// Those in C of the optimum over the fitted budgets.
    pub exponents: PerQuantity<Exponent>,
    /// The optimum from the smallest to the largest fitted budget: what figures draw.
    pub path: Vec<OptimumAt>,
    /// How far each law that could be tested missed each budget that it had not seen.
    pub held_out: Vec<HeldOutError>,
    /// One sentence.
    pub verdict: String,
    pub doubts: Vec<Doubt>,
}

/// A coefficient with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Coefficient {
    pub value: f64,
    pub ci95: Option<[f64; 2]>,
}

/// How far a law through smaller budgets missed one that it had not seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldOutError {
    pub law: String,
    pub budget_flops: f64,
    /// Budgets that the law was fitted to.
    pub n_fitted: usize,
    /// Predicted less measured loss: of the minimum, or, by a joint law, over the cells round it.
    pub error: f64,
}

impl PerQuantity<Exponent> {
    /// Whether no exponent is determined.
    pub fn is_undetermined(&self) -> bool {
        self.named().all(|(_, exponent)| exponent.value.is_none())
    }
}

/// An exponent, or why there is none.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Exponent {
    pub value: Option<f64>,
    /// 95 %.
    pub ci95: Option<[f64; 2]>,
    /// The budgets between which the exponent is that of the optimum.
    pub range_flops: [f64; 2],
    /// Why the value is absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// A reason to believe a fit less.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Doubt {
    pub kind: String,
    pub what: String,
    /// What would settle it.
    #[serde(rename = "do")]
    pub remedy: String,
}

/// The optimum of one budget.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OptimumAt {
    pub budget_flops: f64,
    #[serde(flatten)]
    pub at: PerQuantity<Coefficient>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub loss: Option<Coefficient>,
}
