//! What each law that is believed to some part says at a budget, beside the recommended one.

use super::at_budget::{Vocabulary, fitted_at};
use super::{Allocation, PredictOptions, project};
use crate::laws::{Belief, Candidate, Deviations, Laws};

/// What a law says more than the recommended one does, and how far it is believed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Opinion {
    pub belief: Belief,
    pub shift: Deviations,
}

/// Where a law has its optimum, and the loss there.
type Said = (f64, Allocation);

/// Of every tested law that says something at `budget`; empty where no law was tested.
pub(super) fn opinions(
    laws: &Laws,
    how: (Vocabulary, &PredictOptions),
    own: Said,
    budget: f64,
) -> Vec<Opinion> {
    let recommended = laws.judgement.recommended.as_ref().filter(|_| own.0.is_finite());
    let Some(recommended) = recommended else { return Vec::new() };
    let of = |belief: Belief| {
        let law = belief.law;
        let said = if law == recommended.law { own } else { said(laws, law, how, budget)? };
        Some(Opinion { belief, shift: beyond(own, said) })
    };
    let mut opinions: Vec<Opinion> = recommended.beliefs().into_iter().filter_map(of).collect();
    let sum: f64 = opinions.iter().map(|opinion| opinion.belief.weight).sum();
    opinions.iter_mut().for_each(|opinion| opinion.belief.weight /= sum);
    opinions
}

/// What one law says at a budget.
fn said(
    laws: &Laws,
    law: Candidate,
    (vocabulary, options): (Vocabulary, &PredictOptions),
    budget: f64,
) -> Option<Said> {
    let said = if law.is_joint() {
        let joint = laws.judgement.joint.as_ref().filter(|own| own.candidate() == law)?;
        let best = joint.optimum(budget)?;
        (best.loss, best.into())
    } else {
        let loss = laws.loss_of_minima(law, budget)?;
        let at_c = fitted_at(laws, vocabulary, options.shapes, budget).ok()?;
        (loss, project(&at_c, budget, options.flop_count).ok()?)
    };
    said.0.is_finite().then_some(said)
}

fn beyond(own: Said, other: Said) -> Deviations {
    let ln = |of: fn(&Allocation) -> f64| {
        let ln = (of(&other.1) / of(&own.1)).ln();
        // N_v is 0 where N alone is known.
        if ln.is_finite() { ln } else { 0.0 }
    };
    Deviations {
        loss: other.0 - own.0,
        ln_size: ln(|a| a.params_nonvocab),
        ln_vocab: ln(|a| a.params_vocab),
        ln_tokens: ln(|a| a.tokens),
    }
}
