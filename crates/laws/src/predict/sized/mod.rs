//! The loss of a model that need not be the best one for its FLOPs, as one trained on more tokens is.
//!
//! | step | file |
//! | --- | --- |
//! | which law knows L(N, D), and what it says | `told` |
//! | the values, the keys of `predict --params --json` | `types` |
//! | sentences of caution | `cautions` |

mod cautions;
mod told;
mod types;

pub use types::{ModelSize, SizedIntervals, SizedOptimum, SizedPrediction};

use super::PredictError;
use super::optimum::{below_fit, loss_name};
use crate::laws::{Laws, PerQuantity, interval95};
use told::Told;

/// Bisections for the FLOPs of an equal loss: ln C to 1e-10.
const STEPS: usize = 40;
/// How much fewer FLOPs an equal loss is looked for at.
const LN_FEWEST: f64 = 30.0;

/// The loss of `model` by the law of N and D that `laws` hold, beside the best model for its FLOPs.
///
/// # Errors
/// [`PredictError::NoLossLaw`] if the laws know the loss of optimal models only,
/// [`PredictError::NoVocabulary`] if they need V and it is not given, [`PredictError::OutOfRange`].
pub fn predict_sized(laws: &Laws, model: &ModelSize) -> Result<SizedPrediction, PredictError> {
    let law = Told::of(laws)?;
    let said = law.at(laws, model)?;
    let out_of_range = || PredictError::OutOfRange { laws: laws.name.clone(), budget: said.flops };
    let best = said.best.filter(|_| said.loss.is_finite()).ok_or_else(out_of_range)?;
    let each = |of: fn(&[f64; 2]) -> f64| interval95(said.replicates.iter().map(of));
    let mut prediction = SizedPrediction {
        law: laws.name.clone(),
        form: law.name().to_string(),
        loss_name: loss_name(laws),
        model: PerQuantity {
            params_nonvocab: Some(model.params),
            params_vocab: Some(said.params_vocab),
            n_vocab: said.n_vocab,
            tokens: Some(model.tokens),
            ..PerQuantity::default()
        }
        .under(law.parameters()),
        flops: said.flops,
        loss_normalised: said.loss,
        optimum: law.named(best),
        loss_above_optimum: said.loss - best.loss,
        flops_of_equal_loss: equal_loss(&law, said.loss, said.flops),
        ci95: SizedIntervals {
            loss_normalised: each(|[loss, _]| *loss),
            optimum_loss: each(|[_, best]| *best),
            loss_above_optimum: each(|[loss, best]| loss - best),
        },
        extrapolation_factor: said.flops / laws.range()[1],
        below_fit: below_fit(laws, said.flops),
        warnings: Vec::new(),
    };
    prediction.warnings = cautions::of(&prediction, laws, &law);
    Ok(prediction)
}

/// The FLOPs with which the best model reaches `loss`, at most `flops`; `None` if that is out of reach.
fn equal_loss(law: &Told, loss: f64, flops: f64) -> Option<f64> {
    let (mut low, mut high) = (flops.ln() - LN_FEWEST, flops.ln());
    let above = |ln_flops: f64| Some(law.optimum(ln_flops.exp())?.loss - loss);
    above(low).filter(|above| *above > 0.0)?;
    for _ in 0..STEPS {
        let middle = 0.5 * (low + high);
        if above(middle)? > 0.0 { low = middle } else { high = middle }
    }
    Some((0.5 * (low + high)).exp())
}

#[cfg(test)]
mod tests;
