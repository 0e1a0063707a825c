//! [`Answer`]: what a fit says, once, for screen, figures, report, notebook and files.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::laws::input::method::MinimumMethod;

/// An exponent whose 95 % interval is wider than this is not determined.
const WIDEST: f64 = 1.0;

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
    pub exponents: OwnExponents,
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

/// The exponents in C of the optimum over the fitted range of budgets.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OwnExponents {
    /// Of N, where N_nv and N_v are not told apart; then the next two are absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub params: Option<Exponent>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub params_nonvocab: Option<Exponent>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub params_vocab: Option<Exponent>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tokens: Option<Exponent>,
}

impl OwnExponents {
    /// Each with its symbol, in the order of a table.
    pub fn named(&self) -> impl Iterator<Item = (&'static str, &Exponent)> {
        let all = [
            ("N", &self.params),
            ("N_nv", &self.params_nonvocab),
            ("N_v", &self.params_vocab),
            ("D", &self.tokens),
        ];
        all.into_iter().filter_map(|(name, exponent)| Some((name, exponent.as_ref()?)))
    }

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

impl Exponent {
    /// Without a value where the interval says that it is not known.
    pub(in crate::laws) fn if_told(self) -> Self {
        let wide = self.ci95.filter(|[low, high]| high - low > WIDEST);
        match (self.value, wide) {
            (Some(value), Some([low, high])) => Self {
                value: None,
                reason: Some(format!(
                    "{value:.2} fits best, but anything from {low:.2} to {high:.2} fits too"
                )),
                ..self
            },
            _ => self,
        }
    }
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

impl Doubt {
    pub(in crate::laws) fn new(kind: &str, what: String, remedy: &str) -> Self {
        Self { kind: kind.to_string(), what, remedy: remedy.to_string() }
    }

    /// For a person.
    pub fn sentence(&self) -> String {
        match self.remedy.as_str() {
            "" => format!("{}.", self.what),
            remedy => format!("{}: {remedy}.", self.what),
        }
    }
}

/// The optimum of one budget.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OptimumAt {
    pub budget_flops: f64,
    /// N, where N_nv and N_v are not told apart; then the next two are absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub params: Option<Coefficient>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub params_nonvocab: Option<Coefficient>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub params_vocab: Option<Coefficient>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tokens: Option<Coefficient>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub loss: Option<Coefficient>,
}
