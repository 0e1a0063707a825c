//! What makes the loss of a model less certain than it seems.

use super::told::Told;
use super::types::SizedPrediction;
use crate::laws::text::count;
use crate::laws::{JointLaw, Laws};
use crate::predict::warnings::is_far;

/// Runs that count less than this share are hardly fitted.
const HARDLY: f64 = 0.5;
/// Vocabularies no further apart in logarithms are one.
const SAME: f64 = 1e-6;

pub(super) fn of(prediction: &SizedPrediction, laws: &Laws, law: &Told) -> Vec<String> {
    let sentences = [
        other_law(prediction, laws, law),
        size(prediction, laws),
        vocabulary(prediction, laws),
        off_the_minimum(prediction, laws, law),
        rule(laws, law),
        noise_alone(prediction, law),
    ];
    sentences.into_iter().flatten().collect()
}

/// A size far outside those that were tried.
fn size(prediction: &SizedPrediction, laws: &Laws) -> Option<String> {
    let [low, high] = laws.judgement.tried?.sizes;
    let size = *prediction.model.size()?;
    is_far(size, [low, high]).then(|| {
        format!(
            "{} = {} lies far outside the sizes tried ({} to {}).",
            laws.parameters.size(),
            count(size),
            count(low),
            count(high)
        )
    })
}

/// Another vocabulary than the only one tried.
fn vocabulary(prediction: &SizedPrediction, laws: &Laws) -> Option<String> {
    let (asked, only) = (prediction.model.n_vocab?, laws.only_vocabulary()?);
    ((asked / only).ln().abs() > SAME).then(|| {
        format!("The runs tried V = {only:.0} alone: the law knows nothing of V = {asked:.0}.")
    })
}

/// A model so far from the best one that the joint law was hardly fitted to such runs.
fn off_the_minimum(prediction: &SizedPrediction, laws: &Laws, law: &Told) -> Option<String> {
    let (Told::Joint(..), Some(noise)) = (law, laws.noise) else { return None };
    let counts = JointLaw::counts(prediction.loss_above_optimum, noise.sd);
    (counts < HARDLY).then(|| {
        format!(
            "The joint law is fitted to runs near each budget's minimum: one as far above it as this \
             model counts {counts:.2} of the best run. `isoflop fit --law approach3` counts all runs \
             alike; compare the two."
        )
    })
}

/// Another law than the joint one is recommended, and says another loss of the best model.
fn other_law(prediction: &SizedPrediction, laws: &Laws, law: &Told) -> Option<String> {
    let Told::Joint(..) = law else { return None };
    let own = laws.recommended_law();
    let loss = laws.loss_of_minima(own, prediction.flops)?;
    Some(format!(
        "The recommended law is {}, which knows best models alone: their loss at these FLOPs is {loss:.4} by it, and \
         {:.4} by the joint law.",
        own.about(),
        prediction.optimum.loss_normalised
    ))
}

/// The parametric laws count 6ND, whatever the table's budgets count.
fn rule(laws: &Laws, law: &Told) -> Option<String> {
    (matches!(law, Told::Parametric(_)) && laws.flops_rule != "6nd")
        .then(|| format!("FLOPs are counted as 6ND here, and in the fit by {}.", laws.flops_rule))
}

/// Beyond the fit a joint law's own interval knows nothing of how its forecasts missed.
fn noise_alone(prediction: &SizedPrediction, law: &Told) -> Option<String> {
    if prediction.ci95.loss_normalised.is_none() {
        return Some(format!("{} holds no bootstrap, so there are no intervals.", prediction.law));
    }
    (matches!(law, Told::Joint(..)) && prediction.extrapolation_factor > 1.0).then(|| {
        "These intervals hold the scatter of the runs alone; those of `isoflop predict C` also hold \
         how far the law's forecasts missed."
            .to_string()
    })
}
