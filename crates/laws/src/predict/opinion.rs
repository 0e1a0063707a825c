//! What each law that is believed to some part says at a budget, beside the recommended one.

use super::at_budget::{Vocabulary, fitted_at};
use super::{Allocation, PredictOptions, project};
use crate::laws::{Belief, Candidate, ForecastError, Laws};

/// A number for the loss and one for the logarithm of each part of an allocation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Quantities {
    pub loss: f64,
    pub ln_size: f64,
    pub ln_vocab: f64,
    pub ln_tokens: f64,
}

impl From<ForecastError> for Quantities {
    fn from(error: ForecastError) -> Self {
        let ForecastError { loss, ln_size, ln_vocab, ln_tokens, .. } = error;
        Self { loss, ln_size, ln_vocab, ln_tokens }
    }
}

/// What a law says more than the recommended one does, and how far it is believed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Opinion {
    pub law: Candidate,
    /// Those of all opinions sum to 1.
    pub weight: f64,
    pub shift: Quantities,
    /// Standard deviations for each factor e beyond the fit, on `dof` degrees of freedom.
    pub error: Quantities,
    pub dof: usize,
}

/// Where a law has its optimum, and the loss there.
type Said = (f64, Allocation);

/// Of every tested law that says something at `budget`; empty where no law was tested.
pub(super) fn opinions(
    laws: &Laws,
    (vocabulary, options): (Vocabulary, &PredictOptions),
    own: Said,
    budget: f64,
) -> Vec<Opinion> {
    let recommended = laws.judgement.recommended.as_ref().filter(|_| own.0.is_finite());
    let Some(recommended) = recommended else { return Vec::new() };
    let asked = Asked { laws, vocabulary, budget, options };
    let of = |belief: Belief| {
        let said = if belief.law == recommended.law { own } else { asked.of(belief.law)? };
        let Belief { law, weight, error } = belief;
        Some(Opinion { law, weight, shift: beyond(own, said), error: error.into(), dof: error.dof })
    };
    let mut opinions: Vec<Opinion> = recommended.beliefs().into_iter().filter_map(of).collect();
    let sum: f64 = opinions.iter().map(|opinion| opinion.weight).sum();
    opinions.iter_mut().for_each(|opinion| opinion.weight /= sum);
    opinions
}

/// The laws, and the budget that they are asked for.
struct Asked<'a> {
    laws: &'a Laws,
    vocabulary: Vocabulary,
    budget: f64,
    options: &'a PredictOptions<'a>,
}

impl Asked<'_> {
    fn of(&self, law: Candidate) -> Option<Said> {
        let Self { laws, budget, .. } = *self;
        let said = match law {
            Candidate::Log | Candidate::Floor => (laws.loss_of_minima(law, budget)?, self.lines()?),
            Candidate::Joint | Candidate::JointRepeats => {
                let joint = laws.judgement.joint.as_ref().filter(|own| own.candidate() == law)?;
                let best = joint.optimum(budget)?;
                (best.loss, best.into())
            }
        };
        said.0.is_finite().then_some(said)
    }

    /// What the power laws ask for, spending the budget.
    fn lines(&self) -> Option<Allocation> {
        let Self { laws, vocabulary, budget, options } = *self;
        let at_c = fitted_at(laws, vocabulary, options.shapes, budget).ok()?;
        project(&at_c, budget, options.flop_count).ok()
    }
}

fn beyond(own: Said, other: Said) -> Quantities {
    let ln = |of: fn(&Allocation) -> f64| {
        let ln = (of(&other.1) / of(&own.1)).ln();
        // N_v is 0 where N alone is known.
        if ln.is_finite() { ln } else { 0.0 }
    };
    Quantities {
        loss: other.0 - own.0,
        ln_size: ln(|a| a.params_nonvocab),
        ln_vocab: ln(|a| a.params_vocab),
        ln_tokens: ln(|a| a.tokens),
    }
}
