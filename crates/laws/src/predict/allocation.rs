//! N_nv, N_v and D at a budget, by the fitted laws and by each bootstrap replicate, scaled to spend the budget.

use super::{FlopCount, PredictError, Shape};
use crate::laws::{LawSample, Laws, Optimum, Parameters, PerQuantity};
use crate::predict::shapes::nearest;

/// Relative error of the spent FLOPs at which a projection is done.
const TOLERANCE: f64 = 1e-13;
const MAX_STEPS: usize = 200;

/// N_nv, N_v and D; N, 0 and D where N alone is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Allocation {
    pub params_nonvocab: f64,
    pub params_vocab: f64,
    pub tokens: f64,
}

impl From<Optimum> for Allocation {
    fn from(optimum: Optimum) -> Self {
        let Optimum { params_nonvocab, params_vocab, tokens, .. } = optimum;
        Self { params_nonvocab, params_vocab, tokens }
    }
}

impl Allocation {
    /// Training FLOPs under a rule.
    pub fn flops(&self, count: FlopCount) -> f64 {
        (count.flops)(self.params_nonvocab, self.params_vocab, self.tokens)
    }

    /// The same under the names of `parameters`; without V.
    pub(super) fn named(&self, parameters: Parameters) -> PerQuantity<f64> {
        let all = PerQuantity {
            params_nonvocab: Some(self.params_nonvocab),
            params_vocab: Some(self.params_vocab),
            tokens: Some(self.tokens),
            ..PerQuantity::default()
        };
        all.under(parameters)
    }

    /// V of the shape nearest to N_nv.
    pub(super) fn n_vocab(&self, shapes: &[Shape]) -> Option<f64> {
        Some(self.params_vocab / width_for(self.params_nonvocab, shapes).ok()?)
    }

    fn scaled(&self, factor: f64) -> Self {
        Self {
            params_nonvocab: factor * self.params_nonvocab,
            params_vocab: factor * self.params_vocab,
            tokens: factor * self.tokens,
        }
    }

    pub(super) fn is_finite(&self) -> bool {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        let vocab_is_finite = self.params_vocab.is_finite() && self.params_vocab >= 0.0;
        positive(self.params_nonvocab) && vocab_is_finite && positive(self.tokens)
    }
}

/// The allocation with the same N_v/N_nv and N/D that spends the budget.
///
/// All three are scaled by one factor e^−s. Under `6nd`, s = r/2 with r = ln(spent/C): the smallest change of ln N and
/// ln D that spends C. Under another rule s is found by the iteration s ← s + r/2, which converges if the count grows
/// with an exponent between 0 and 4 as model and tokens grow together; every rule's lies between 1 and 2.
///
/// # Errors
/// [`PredictError::NotProjected`] if it does not converge.
pub fn project(
    raw: &Allocation,
    budget: f64,
    count: FlopCount,
) -> Result<Allocation, PredictError> {
    let mut ln_factor = 0.0f64;
    for _ in 0..MAX_STEPS {
        let allocation = raw.scaled(ln_factor.exp());
        let excess = (allocation.flops(count) / budget).ln();
        if excess.abs() <= TOLERANCE {
            return Ok(allocation);
        }
        ln_factor -= 0.5 * excess;
    }
    Err(PredictError::NotProjected { budget, rule: count.rule.to_string() })
}

// The laws' own values at a budget.

/// How N_v is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Vocabulary {
    /// By its law in C.
    Law,
    /// No vocabulary: the laws have N in place of N_nv.
    None,
    /// One vocabulary was tried: N_v = V·d, d being the width of the shape nearest to N_nv.
    Fixed(f64),
}

impl Vocabulary {
    /// # Errors
    /// [`PredictError::MissingLaw`] without a law or a single vocabulary.
    pub fn of(laws: &Laws) -> Result<Self, PredictError> {
        if laws.parameters == Parameters::Total {
            return Ok(Self::None);
        }
        let joint = laws.joint_law();
        if laws.power_laws.params_vocab.is_some() || joint.is_some_and(|law| law.loss.terms.vocab) {
            return Ok(Self::Law);
        }
        laws.only_vocabulary().map(Self::Fixed).ok_or_else(|| missing(laws, "N_v"))
    }
}

fn missing(laws: &Laws, quantity: &'static str) -> PredictError {
    PredictError::MissingLaw { laws: laws.name.clone(), quantity }
}

/// N_nv, N_v and D of the laws as fitted at C.
///
/// # Errors
/// [`PredictError::MissingLaw`] and [`PredictError::OutOfRange`].
pub(super) fn fitted_at(
    laws: &Laws,
    vocabulary: Vocabulary,
    shapes: &[Shape],
    budget: f64,
) -> Result<Allocation, PredictError> {
    let law = |symbol| {
        let law = laws.power_laws.of(symbol).ok_or_else(|| missing(laws, symbol))?;
        Ok((law.ln_at_reference, law.exponent))
    };
    read_at(law, laws, (vocabulary, shapes), budget)
}

/// N_nv, N_v and D of one replicate at C; none if they leave the range of numbers.
pub(super) fn sample_at(
    sample: &LawSample,
    laws: &Laws,
    vocabulary: Vocabulary,
    shapes: &[Shape],
    budget: f64,
) -> Option<Allocation> {
    let law = |symbol| match symbol {
        "N_v" => Ok(sample.vocab()),
        "D" => Ok(sample.tokens()),
        _ => Ok(sample.size()),
    };
    read_at(law, laws, (vocabulary, shapes), budget).ok()
}

/// y(C0) (C/C0)^exponent of each quantity, `law` giving ln y(C0) and the exponent.
fn read_at(
    law: impl Fn(&'static str) -> Result<(f64, f64), PredictError>,
    laws: &Laws,
    (vocabulary, shapes): (Vocabulary, &[Shape]),
    budget: f64,
) -> Result<Allocation, PredictError> {
    let step = budget.ln() - laws.reference_flops.ln();
    let at = |symbol| law(symbol).map(|(level, exponent)| (level + exponent * step).exp());
    let params_nonvocab = at(if vocabulary == Vocabulary::None { "N" } else { "N_nv" })?;
    let params_vocab = match vocabulary {
        Vocabulary::None => 0.0,
        Vocabulary::Law => at("N_v")?,
        Vocabulary::Fixed(n_vocab) => n_vocab * width_for(params_nonvocab, shapes)?,
    };
    let allocation = Allocation { params_nonvocab, params_vocab, tokens: at("D")? };
    match allocation.is_finite() {
        true => Ok(allocation),
        false => Err(PredictError::OutOfRange { laws: laws.name.clone(), budget }),
    }
}

/// The shape nearest to N_nv.
pub(super) fn shape_for(params_nonvocab: f64, shapes: &[Shape]) -> Result<&Shape, PredictError> {
    nearest(shapes, params_nonvocab, |shape| shape.params_nonvocab() as f64)
        .ok_or(PredictError::NothingToChoose("shapes"))
}

/// d of the shape nearest to N_nv.
pub(super) fn width_for(params_nonvocab: f64, shapes: &[Shape]) -> Result<f64, PredictError> {
    shape_for(params_nonvocab, shapes).map(|shape| shape.d_model as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_projection_spends_the_budget_and_keeps_both_ratios(
            ln_nonvocab in 5.0..30.0f64,
            ln_share in -8.0..2.0f64,
            ln_tokens in 5.0..30.0f64,
            log10_budget in 6.0..26.0f64,
        ) {
            let params_nonvocab = ln_nonvocab.exp();
            let raw = Allocation {
                params_nonvocab,
                params_vocab: params_nonvocab * ln_share.exp(),
                tokens: ln_tokens.exp(),
            };
            let budget = 10f64.powf(log10_budget);
            // Attention's share falls as models grow, as the rule `openai` has it.
            let attention = FlopCount {
                rule: "openai",
                flops: &|n, v, d| 6.0 * (n + v + 40.0 * n.powf(0.667)) * d,
            };
            for count in [FlopCount::SIX_ND, attention] {
                let projected = project(&raw, budget, count).unwrap();
                prop_assert!((projected.flops(count) / budget - 1.0).abs() < 1e-9);
                let same = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-12;
                prop_assert!(same(
                    projected.params_vocab / projected.params_nonvocab,
                    raw.params_vocab / raw.params_nonvocab,
                ));
                prop_assert!(same(
                    projected.tokens / projected.params_nonvocab,
                    raw.tokens / raw.params_nonvocab,
                ));
            }
        }
    }

    #[test]
    fn a_count_that_does_not_grow_is_refused() {
        let flat = FlopCount { rule: "flat", flops: &|_, _, _| 1.0 };
        let raw = Allocation { params_nonvocab: 1e6, params_vocab: 1e5, tokens: 1e7 };
        assert_eq!(
            project(&raw, 1e12, flat),
            Err(PredictError::NotProjected { budget: 1e12, rule: "flat".into() })
        );
    }
}
