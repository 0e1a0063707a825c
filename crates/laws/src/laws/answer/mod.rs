//! How an [`Answer`] follows from laws.
//!
//! | part | file |
//! | --- | --- |
//! | the optimum along the fitted budgets | `path` |
//! | the exponents of the optimum, or why there is none | `exponents` |
//! | the coefficients of the loss | `coefficients` |
//! | the formula, what is in doubt, the verdict | in words, `say` |

pub(in crate::laws) mod coefficients;
pub(in crate::laws) mod exponents;
pub(in crate::laws) mod path;

use crate::laws::file::answer::{Answer, HeldOutError};
use crate::laws::file::kind::LawKind;
use crate::laws::file::laws::Laws;
use crate::laws::input::method::MinimumMethod;
use crate::laws::ranking::miss::Miss;
use crate::laws::ranking::recommended::Candidate;
use crate::laws::say::doubts::{doubts, verdict};
use crate::laws::say::formula::formula;
use crate::laws::say::reasons::Undetermined;

impl Laws {
    /// What they say; of an older file, which has no answer, made here.
    pub fn answer(&self) -> Answer {
        self.answer.clone().unwrap_or_else(|| self.own_answer())
    }

    /// The same for another amount of data: what the joint law with repetition says where `unique_tokens` are
    /// distinct, whichever law is the one to believe, since the others know no data but their own. None
    /// without such a law.
    pub fn on_data(&self, unique_tokens: f64) -> Option<Self> {
        let mut laws = self.clone();
        let joint = laws.judgement.joint.as_ref().filter(|law| law.tells_repetition())?;
        laws.judgement.joint = Some(joint.on_data(unique_tokens));
        laws.judgement.tried.as_mut()?.unique_tokens = Some(unique_tokens);
        let recommended = laws.judgement.recommended.as_mut()?;
        recommended.law = Candidate::JointRepeats;
        recommended.scores.retain(|score| score.law == Candidate::JointRepeats);
        Some(laws.answered())
    }

    /// The laws with their answer, which follows from all else that they hold.
    pub fn answered(mut self) -> Self {
        self.answer = Some(self.own_answer());
        self
    }

    pub(super) fn own_answer(&self) -> Answer {
        let found = exponents::of(self);
        let undetermined: Vec<(&str, Undetermined)> =
            found.named().filter_map(|(name, own)| Some((name, own.why?))).collect();
        let exponents = found.map(|own| own.told(self.range()));
        let doubts = doubts(self, &exponents, &undetermined);
        let (symbol, coefficients) = (self.loss_symbol(), coefficients::of(self));
        Answer {
            law: self.own_law().to_string(),
            method: self.own_method(),
            why: self.judgement.recommended.as_ref().map_or_else(String::new, |r| r.why.clone()),
            formula: formula(self, symbol, &coefficients),
            coefficients,
            loss_unit: if self.from_sweep { "nats" } else { "as given" }.to_string(),
            verdict: verdict(self, !exponents.is_undetermined(), &doubts),
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
