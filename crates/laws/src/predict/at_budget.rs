//! The laws' own values at a budget, for the laws as fitted and for each bootstrap replicate.

use super::shapes::nearest;
use super::{Allocation, PredictError, Shape};
use crate::laws::{LawSample, Laws, Parameters, PowerLaw};

/// How N_v is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Vocabulary {
    /// By its law in C.
    Law,
    /// It is not: the laws are of N, which stands in the place of N_nv.
    None,
    /// One vocabulary was tried: N_v = V·d, d being the width of the shape nearest to N_nv.
    Fixed(f64),
}

impl Vocabulary {
    /// # Errors
    /// [`PredictError::MissingLaw`] where there is neither a law nor a single vocabulary.
    pub fn of(laws: &Laws) -> Result<Self, PredictError> {
        if laws.parameters == Parameters::Total {
            return Ok(Self::None);
        }
        let joint = laws.judgement.joint.as_ref().filter(|_| laws.recommended_law().is_joint());
        if laws.power_laws.params_vocab.is_some() || joint.is_some_and(|law| law.loss.terms.vocab) {
            return Ok(Self::Law);
        }
        if let Some(only) = laws.only_vocabulary() {
            return Ok(Self::Fixed(only));
        }
        // An older file does not say what was tried.
        let mut tried = laws.minima.iter().map(|minimum| minimum.n_vocab);
        let missing = || missing(laws, "N_v");
        let first = tried.next().ok_or_else(missing)?;
        let same = |v: f64| (v / first - 1.0).abs() < 1e-6;
        if tried.all(same) { Ok(Self::Fixed(first)) } else { Err(missing()) }
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
    let at = |law: &PowerLaw| value(law.ln_at_reference, law.exponent, laws, budget);
    let law = |law: &Option<PowerLaw>, quantity| {
        law.as_ref().map(at).ok_or_else(|| missing(laws, quantity))
    };
    let params_nonvocab = match vocabulary {
        Vocabulary::None => law(&laws.power_laws.params, "N")?,
        _ => law(&laws.power_laws.params_nonvocab, "N_nv")?,
    };
    let params_vocab = match vocabulary {
        Vocabulary::None => 0.0,
        Vocabulary::Law => law(&laws.power_laws.params_vocab, "N_v")?,
        Vocabulary::Fixed(n_vocab) => n_vocab * width_for(params_nonvocab, shapes)?,
    };
    let tokens = law(&laws.power_laws.tokens, "D")?;
    let allocation = Allocation { params_nonvocab, params_vocab, tokens };
    let out_of_range = PredictError::OutOfRange { laws: laws.name.clone(), budget };
    if allocation.is_finite() { Ok(allocation) } else { Err(out_of_range) }
}

/// N_nv, N_v and D of one replicate at C; none where they leave the range of numbers.
pub(super) fn sample_at(
    sample: &LawSample,
    laws: &Laws,
    vocabulary: Vocabulary,
    shapes: &[Shape],
    budget: f64,
) -> Option<Allocation> {
    let at = |level, exponent| value(level, exponent, laws, budget);
    let params_nonvocab = at(sample.ln_nonvocab_at_reference, sample.exponent_nonvocab);
    let params_vocab = match vocabulary {
        Vocabulary::None => 0.0,
        Vocabulary::Law => at(sample.ln_vocab_at_reference, sample.exponent_vocab),
        Vocabulary::Fixed(n_vocab) => n_vocab * width_for(params_nonvocab, shapes).ok()?,
    };
    let tokens = at(sample.ln_tokens_at_reference, sample.exponent_tokens);
    let allocation = Allocation { params_nonvocab, params_vocab, tokens };
    allocation.is_finite().then_some(allocation)
}

/// y(C0) (C/C0)^exponent.
fn value(ln_at_reference: f64, exponent: f64, laws: &Laws, budget: f64) -> f64 {
    (ln_at_reference + exponent * (budget.ln() - laws.reference_flops.ln())).exp()
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
