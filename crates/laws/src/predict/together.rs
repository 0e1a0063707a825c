//! [`Together`]: what all tested laws forecast together, beside the recommended one.

use super::at_budget::Vocabulary;
use super::opinion::Opinion;
use super::{Allocation, PredictError, PredictOptions, Prediction, Together, Weighed, project};
use crate::laws::{Belief, Deviations, PerQuantity};

/// Shares of a forecast that are not worth telling.
const NOTHING: f64 = 0.005;

/// The forecast of several laws; `None` within the fit, and where one law says it all.
///
/// `own` is the recommended law's, which asks for `on_budget`.
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
