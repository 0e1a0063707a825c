//! Predictions of the other tested laws at a budget, the widening of intervals with the distance from the fit, and the
//! weighted mean of all laws.

use super::{Allocation, PredictError, PredictOptions, Prediction, Together, Weighed, project};
use crate::laws::{Belief, Candidate, Deviations, Laws, Normals, PerQuantity};
use crate::predict::allocation::{Vocabulary, fitted_at};

/// The difference of a law's prediction from the recommended one, and its weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Opinion {
    pub belief: Belief,
    pub shift: Deviations,
}

/// The optimum of a law, and the loss there.
type Said = (f64, Allocation);

/// The predictions of every tested law at `budget`; empty if no law was tested.
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
        Some(Opinion { belief, shift: shift(own, said) })
    };
    let mut opinions: Vec<Opinion> = recommended.beliefs().into_iter().filter_map(of).collect();
    let sum: f64 = opinions.iter().map(|opinion| opinion.belief.weight).sum();
    opinions.iter_mut().for_each(|opinion| opinion.belief.weight /= sum);
    opinions
}

/// The prediction of one law at a budget.
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

fn shift(own: Said, other: Said) -> Deviations {
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

// The part of an interval that grows with the distance from the fit.

/// The forecast error at a distance from the fit, drawn for each replicate: the law, and its error.
pub(super) struct Spread {
    opinions: Vec<Opinion>,
    /// ln of the budget over the largest fitted; 0 within the fit.
    distance: f64,
}

/// Draws per replicate of a law, to fill the tails.
const DRAWS: u64 = 20;

impl Spread {
    /// At `factor` times the largest fitted budget.
    pub fn new(opinions: Vec<Opinion>, factor: f64) -> Self {
        Self { opinions, distance: factor.ln().max(0.0) }
    }

    /// Values moved by the quantity that `of` names.
    pub fn of(&self, values: impl Iterator<Item = f64>, of: fn(&Deviations) -> f64) -> Vec<f64> {
        self.moved(values, of, |value, change| value + change)
    }

    /// Positive values, whose logarithms are moved.
    pub fn of_logs(
        &self,
        values: impl Iterator<Item = f64>,
        of: fn(&Deviations) -> f64,
    ) -> Vec<f64> {
        self.moved(values, of, |value, change| value * change.exp())
    }

    fn moved(
        &self,
        values: impl Iterator<Item = f64>,
        of: fn(&Deviations) -> f64,
        apply: impl Fn(f64, f64) -> f64,
    ) -> Vec<f64> {
        if self.opinions.is_empty() || self.distance == 0.0 {
            return values.collect();
        }
        let mut moved = Vec::new();
        for (i, value) in values.enumerate() {
            let mut normals = Normals::of_stream(0, i as u64);
            moved.extend((0..DRAWS).map(|_| apply(value, self.change(&mut normals, of))));
        }
        moved
    }

    /// A law by its weight, and a miss of it: normal, with a deviation that is itself known to few
    /// degrees of freedom.
    fn change(&self, normals: &mut Normals, of: fn(&Deviations) -> f64) -> f64 {
        let Opinion { shift, belief: Belief { error, .. } } = self.drawn(normals.uniform());
        let scale = (error.dof as f64 / normals.chi_square(error.dof)).sqrt();
        of(shift) + of(&error.sd) * self.distance * scale * normals.draw()
    }

    fn drawn(&self, mut share: f64) -> &Opinion {
        let mut opinions = self.opinions.iter();
        let last = &self.opinions[self.opinions.len() - 1];
        opinions
            .find(|opinion| {
                share -= opinion.belief.weight;
                share < 0.0
            })
            .unwrap_or(last)
    }
}

// The weighted mean of all tested laws.

/// Shares of a forecast that are not worth telling.
const NOTHING: f64 = 0.005;

/// The weighted mean of several laws; `None` within the fit, or with a single law.
///
/// `own` is the recommended law's prediction, with the allocation `on_budget`.
///
/// # Errors
/// [`PredictError::NotProjected`].
pub(super) fn together(
    own: &Prediction,
    (vocabulary, on_budget): (Vocabulary, &Allocation),
    opinions: &[Opinion],
    options: &PredictOptions,
) -> Result<Option<Together>, PredictError> {
    let laws = weighed(opinions);
    let loss = own.loss_normalised.filter(|_| own.extrapolation_factor > 1.0 && laws.len() > 1);
    let Some(loss) = loss else { return Ok(None) };
    let shift = mean(opinions);
    let moved = Allocation {
        params_nonvocab: on_budget.params_nonvocab * shift.ln_size.exp(),
        params_vocab: on_budget.params_vocab * shift.ln_vocab.exp(),
        tokens: on_budget.tokens * shift.ln_tokens.exp(),
    };
    let spent = on_budget.flops(options.flop_count);
    let moved = project(&moved, spent, options.flop_count)?;
    let size = moved.params_nonvocab / on_budget.params_nonvocab;
    let vocab = moved.params_vocab / on_budget.params_vocab;
    let by_law = vocabulary == Vocabulary::Law;
    Ok(Some(Together {
        laws,
        loss_normalised: loss + shift.loss,
        at: PerQuantity {
            params: own.at.params.map(|n| n * size),
            params_nonvocab: own.at.params_nonvocab.map(|n| n * size),
            params_vocab: own.at.params_vocab.map(|n| n * vocab),
            n_vocab: own.at.n_vocab.map(|v| if by_law { v * vocab } else { v }),
            tokens: Some(moved.tokens),
        },
    }))
}

fn weighed(opinions: &[Opinion]) -> Vec<Weighed> {
    let heard = opinions.iter().map(|opinion| opinion.belief).filter(|own| own.weight >= NOTHING);
    let mut laws: Vec<Weighed> =
        heard.map(|Belief { law, weight, .. }| Weighed { law, weight }).collect();
    laws.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    laws
}

fn mean(opinions: &[Opinion]) -> Deviations {
    let mean = |of: fn(&Deviations) -> f64| {
        opinions.iter().map(|opinion| opinion.belief.weight * of(&opinion.shift)).sum()
    };
    Deviations {
        loss: mean(|q| q.loss),
        ln_size: mean(|q| q.ln_size),
        ln_vocab: mean(|q| q.ln_vocab),
        ln_tokens: mean(|q| q.ln_tokens),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::ForecastError;

    fn opinion(weight: f64, loss: f64) -> Opinion {
        let shift = Deviations { loss, ..Deviations::default() };
        let error = ForecastError { sd: Deviations::default(), dof: 4, tested: 0 };
        Opinion { belief: Belief { law: Candidate::Log, weight, error }, shift }
    }

    #[test]
    fn each_law_moves_its_share_of_the_values() {
        let spread = Spread::new(vec![opinion(0.75, 0.0), opinion(0.25, 1.0)], 10.0);
        let moved = spread.of((0..500).map(|_| -3.0), |q| q.loss);
        let above = moved.iter().filter(|value| **value == -2.0).count() as f64;
        assert!(moved.iter().all(|value| [-3.0, -2.0].contains(value)));
        assert!((above / moved.len() as f64 - 0.25).abs() < 0.02, "{above}");
    }

    #[test]
    fn nothing_moves_within_the_fit() {
        let spread = Spread::new(vec![opinion(1.0, 1.0)], 0.5);
        assert_eq!(spread.of([-3.0].into_iter(), |q| q.loss), [-3.0]);
    }
}
