//! The laws' own values at a budget, for the laws as fitted and for each bootstrap replicate.

use super::shapes::nearest;
use super::{Allocation, PredictError, Shape};
use crate::laws::{LawSample, Laws, Parameters};

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

/// N_nv, N_v and D of one replicate at C; none where they leave the range of numbers.
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
