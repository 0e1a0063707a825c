//! What is compared: exponents, and optima at a budget.

use anyhow::Result;
use isoflop::laws::{Difference, Estimate, Exponent, Laws, OwnExponents};
use isoflop::predict::{PredictError, Prediction};
use serde::Serialize;

use super::study::Study;
use crate::commands::predict::predict_one;

/// A quantity of every study.
#[derive(Serialize)]
pub struct Quantity {
    pub name: &'static str,
    /// Whether differences are ratios.
    pub is_ratio: bool,
    /// `None` where a study does not have it.
    pub estimates: Vec<Option<Estimate>>,
    /// Each study less the first, or divided by it, in logarithms; `None` for the first.
    pub differences: Vec<Option<Difference>>,
}

type Of<T> = fn(&T) -> Option<Estimate>;

/// Those that `isoflop fit` prints: of the law to believe.
const EXPONENTS: [(&str, Of<OwnExponents>); 4] = [
    ("exponent of N_nv in C", |own| exponent(own.params_nonvocab.as_ref())),
    ("exponent of N_v in C", |own| exponent(own.params_vocab.as_ref())),
    ("exponent of N in C", |own| exponent(own.params.as_ref())),
    ("exponent of D in C", |own| exponent(own.tokens.as_ref())),
];

const OPTIMA: [(&str, Of<Prediction>); 5] = [
    ("N_nv", |found| {
        Some(Estimate { value: found.params_nonvocab?, ci95: found.ci95.params_nonvocab })
    }),
    ("N_v", |found| Some(Estimate { value: found.params_vocab?, ci95: found.ci95.params_vocab })),
    ("N", |found| Some(Estimate { value: found.params?, ci95: found.ci95.params })),
    ("V", |found| Some(Estimate { value: found.n_vocab?, ci95: found.ci95.n_vocab })),
    ("D", |found| Some(Estimate { value: found.tokens, ci95: found.ci95.tokens })),
];

impl Quantity {
    /// All that some study has.
    pub fn all(studies: &[Study], budget: f64) -> Result<Vec<Self>> {
        let optima = studies.iter().map(|study| predict_one(&study.laws, budget));
        let told = optima.map(|optimum| match optimum {
            Err(PredictError::NoOptimum { .. }) => Ok(None),
            other => other.map(Some),
        });
        let optima: Vec<Option<Prediction>> = told.collect::<Result<_, PredictError>>()?;
        let own: Vec<OwnExponents> =
            studies.iter().map(|study| study.laws.answer().exponents).collect();
        let of_laws = EXPONENTS
            .iter()
            .map(|(name, of)| Self::new(name, false, own.iter().map(of).collect()))
            .chain([Self::new(
                "exponent of N_v in N_nv",
                false,
                studies
                    .iter()
                    .zip(&own)
                    .map(|(study, own)| of_vocabulary(&study.laws, own))
                    .collect(),
            )]);
        let of_optima = OPTIMA.iter().map(|(name, of)| {
            let estimates = optima.iter().map(|optimum| of(optimum.as_ref()?)).collect();
            Self::new(name, true, estimates)
        });
        let all = of_laws.chain(of_optima);
        Ok(all.filter(|quantity| quantity.estimates.iter().any(Option::is_some)).collect())
    }

    fn new(name: &'static str, is_ratio: bool, estimates: Vec<Option<Estimate>>) -> Self {
        let scaled = |estimate: Estimate| if is_ratio { estimate.ln() } else { estimate };
        let first = estimates[0].map(scaled);
        let less =
            |estimate: &Option<Estimate>| Some(Difference::of(estimate.map(scaled)?, first?));
        let others = estimates[1..].iter().map(less);
        let differences = [None].into_iter().chain(others).collect();
        Self { name, is_ratio, estimates, differences }
    }
}

/// Of a joint law the ratio of its two exponents; of others that of their own law.
fn of_vocabulary(laws: &Laws, own: &OwnExponents) -> Option<Estimate> {
    if laws.recommended_law().is_joint() {
        let [vocab, size] =
            [&own.params_vocab, &own.params_nonvocab].map(|own| own.as_ref()?.value);
        return Some(Estimate { value: vocab? / size?, ci95: None });
    }
    let law = laws.vocab_from_nonvocab.as_ref()?;
    Some(Estimate { value: law.exponent, ci95: law.exponent_ci95 })
}

/// `None` where it is not determined.
fn exponent(own: Option<&Exponent>) -> Option<Estimate> {
    own.and_then(|own| Some(Estimate { value: own.value?, ci95: own.ci95 }))
}
