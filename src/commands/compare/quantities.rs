//! What is compared: exponents, and optima at a budget.

use anyhow::Result;
use isoflop::laws::{Difference, Estimate, Exponent, Laws, PerQuantity};
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

/// Exponents that `isoflop fit` prints, and their symbols: of the law to believe.
const EXPONENTS: [(&str, &str); 4] = [
    ("exponent of N_nv in C", "N_nv"),
    ("exponent of N_v in C", "N_v"),
    ("exponent of N in C", "N"),
    ("exponent of D in C", "D"),
];
/// What is compared of an optimum.
const OPTIMA: [&str; 5] = ["N_nv", "N_v", "N", "V", "D"];

impl Quantity {
    /// All that some study has.
    pub fn all(studies: &[Study], budget: f64) -> Result<Vec<Self>> {
        let optima = studies.iter().map(|study| predict_one(&study.laws, budget));
        let told = optima.map(|optimum| match optimum {
            Err(PredictError::NoOptimum { .. }) => Ok(None),
            other => other.map(Some),
        });
        let optima: Vec<Option<Prediction>> = told.collect::<Result<_, PredictError>>()?;
        let own: Vec<PerQuantity<Exponent>> =
            studies.iter().map(|study| study.laws.answer().exponents).collect();
        let of_laws = EXPONENTS.iter().map(|(name, symbol)| {
            Self::new(name, false, own.iter().map(|own| exponent(own.of(symbol)?)).collect())
        });
        let vocabularies = studies.iter().zip(&own);
        let vocabularies = vocabularies.map(|(study, own)| of_vocabulary(&study.laws, own));
        let of_laws =
            of_laws.chain([Self::new("exponent of N_v in N_nv", false, vocabularies.collect())]);
        let of_optima = OPTIMA.iter().map(|symbol| {
            let of = |found: &Prediction| {
                let ci95 = found.ci95.at.of(symbol).copied();
                Some(Estimate { value: *found.at.of(symbol)?, ci95 })
            };
            let estimates = optima.iter().map(|optimum| of(optimum.as_ref()?)).collect();
            Self::new(symbol, true, estimates)
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
fn of_vocabulary(laws: &Laws, own: &PerQuantity<Exponent>) -> Option<Estimate> {
    if laws.recommended_law().is_joint() {
        let [vocab, size] =
            [&own.params_vocab, &own.params_nonvocab].map(|own| own.as_ref()?.value);
        return Some(Estimate { value: vocab? / size?, ci95: None });
    }
    let law = laws.vocab_from_nonvocab.as_ref()?;
    Some(Estimate { value: law.exponent, ci95: law.exponent_ci95 })
}

/// `None` where it is not determined.
fn exponent(own: &Exponent) -> Option<Estimate> {
    Some(Estimate { value: own.value?, ci95: own.ci95 })
}
