//! [`Answer`]: what a fit says, once, for screen, figures, report, notebook and files.
//!
//! | part | file |
//! | --- | --- |
//! | the optimum along the fitted budgets | `path` |
//! | the exponents of the optimum, or why there is none | `exponents` |
//! | the loss as a formula with its coefficients | `formula` |
//! | what is in doubt, and what to do about it | `doubts` |

mod doubts;
mod exponents;
mod formula;
mod path;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{Candidate, LawKind, Laws, Miss};
use crate::laws::MinimumMethod;
pub use doubts::Doubt;
pub use exponents::{Exponent, OwnExponents};
pub use path::OptimumAt;

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

impl Laws {
    /// The laws with their answer, which follows from all else that they hold.
    pub fn answered(mut self) -> Self {
        self.answer = Some(self.own_answer());
        self
    }

    pub(super) fn own_answer(&self) -> Answer {
        let (formula, coefficients) = formula::of(self);
        let exponents = exponents::of(self);
        let doubts = doubts::of(self, &exponents);
        Answer {
            law: self.own_law().to_string(),
            method: self.own_method(),
            why: self.judgement.recommended.as_ref().map_or_else(String::new, |r| r.why.clone()),
            formula,
            coefficients,
            loss_unit: if self.from_sweep { "nats" } else { "as given" }.to_string(),
            verdict: doubts::verdict(self, &exponents, &doubts),
            path: path::of(self),
            exponents,
            held_out: self.misses(),
            doubts,
        }
    }

    fn own_law(&self) -> &'static str {
        match self.law {
            LawKind::Isoflop => self.recommended_law().name(),
            other => other.name(),
        }
    }

    /// The minima that the recommended law goes through.
    fn own_method(&self) -> Option<MinimumMethod> {
        let lines = matches!(self.recommended_law(), Candidate::Log | Candidate::Floor);
        (self.law == LawKind::Isoflop && lines).then_some(self.minima_method)
    }

    fn misses(&self) -> Vec<HeldOutError> {
        let scores = self.judgement.recommended.iter().flat_map(|r| &r.scores);
        let of = |law: Candidate, miss: &Miss| HeldOutError {
            law: law.name().to_string(),
            budget_flops: miss.budget_flops,
            n_fitted: miss.n_fitted,
            error: miss.loss.by,
        };
        scores.flat_map(|score| score.compared().map(move |miss| of(score.law, miss))).collect()
    }
}
