//! The laws of the optimum that follow from a parametric loss.
//!
//! For approach 3 they are exact: N and D are powers of C, and the loss at the optimum is a power
//! law with the floor E. With a vocabulary they are the tangents at C0; a prediction elsewhere goes
//! back to the loss itself.

use super::unfitted::unfitted;
use crate::laws::file::kind::LawKind;
use crate::laws::file::laws::Laws;
use crate::laws::input::error::FitError;
use crate::laws::input::point::{IsoFlopPoint, Parameters};
use crate::laws::lines::intervals;
use crate::laws::lines::sample::{FloorSample, LawSample};
use crate::laws::lines::types::{FloorLaw, PowerLaw, PowerLaws};
use crate::laws::maths::stats::{geometric_mean, interval95};
use crate::laws::minima::types::Optimum;
use crate::laws::parametric::findings::Finding;
use crate::laws::parametric::fit::fitted;
use crate::laws::parametric::form::{Coefficients, Form};
use crate::laws::parametric::optimum::{optimum, vocab_exponent};
use crate::laws::parametric::options::ParametricOptions;
use crate::laws::parametric::types::Parametric;
use crate::laws::say::warnings::of_lost_optima;
use std::f64::consts::LN_10;

/// Fits a parametric law: the global optimum, how sure it is, and what speaks against it.
///
/// # Errors
/// [`FitError::BadValue`], [`FitError::BadLoss`], [`FitError::Metrics`] and [`FitError::BadOption`] for
/// wrong input, [`FitError::NotIdentified`] where the rows cannot tell the coefficients.
pub fn fit_parametric(
    points: &[IsoFlopPoint],
    options: &ParametricOptions,
) -> Result<Parametric, FitError> {
    let (own, findings) = fitted(points, options)?;
    let size = options.form.quantities()[0];
    let of_rows = own.influence.as_ref().map(|influence| influence.sentence(size));
    let warnings = findings.iter().map(Finding::sentence).chain(of_rows).collect();
    Ok(Parametric { warnings, ..own })
}

/// Half the step in ln C over which exponents are read off.
const HALF_STEP: f64 = 0.01;

/// The laws that `parametric`, fitted to `points`, implies; those that it does not are absent.
pub fn parametric_laws(
    points: &[IsoFlopPoint],
    parametric: Parametric,
    name: &str,
    flops_rule: &str,
) -> Laws {
    let reference = geometric_mean(points.iter().map(|p| p.flops));
    let form = parametric.coefficients.form;
    let kind = LawKind::Parametric(form);
    let mut laws = unfitted(kind, (name, flops_rule), form.parameters(), reference, points);
    laws.parametric = Some(parametric);
    around(&laws, reference)
}

/// The same laws as tangents at another C0; laws without a parametric loss are left as they are.
///
/// Only a loss with a vocabulary has laws that bend; read at C0 = C they are exact.
pub fn around(laws: &Laws, reference: f64) -> Laws {
    let mut laws = laws.clone();
    let Some(parametric) = laws.parametric.take() else { return laws };
    let samples: Vec<LawSample> =
        parametric.bootstrap.iter().filter_map(|c| tangent(c, reference)).collect();
    if let Some(own) = tangent(&parametric.coefficients, reference) {
        let form = parametric.coefficients.form;
        laws.power_laws = power_laws(&own, &samples, form, reference, parametric.n);
        laws.loss.floor = own.floor.map(|law| floor_law(&law, &samples, &parametric));
        laws.vocab_from_nonvocab =
            (form.parameters() == Parameters::Split).then(|| vocabulary(&own, &parametric));
    }
    laws.reference_flops = reference;
    // The warnings of the parametric loss itself are doubts of the answer.
    let all = parametric.bootstrap.len();
    laws.warnings = of_lost_optima(all - samples.len(), all).into_iter().collect();
    laws.bootstrap = samples;
    laws.parametric = Some(parametric);
    laws.answered()
}

/// The laws around C0 as one replicate keeps them; none where the coefficients have no optimum.
fn tangent(c: &Coefficients, reference: f64) -> Option<LawSample> {
    let at = |ln_step: f64| optimum(c, reference * ln_step.exp());
    let (below, here, above) = (at(-HALF_STEP)?, at(0.0)?, at(HALF_STEP)?);
    let exponent =
        |of: fn(&Optimum) -> f64| (of(&above).ln() - of(&below).ln()) / (2.0 * HALF_STEP);
    let split = c.form.parameters() == Parameters::Split;
    let excess = [below, here, above].map(|o| o.loss - c.floor());
    let slope = (excess[2].ln() - excess[0].ln()) / (2.0 * HALF_STEP);
    Some(LawSample {
        ln_vocab_at_reference: if split { here.params_vocab.ln() } else { 0.0 },
        exponent_vocab: if split { exponent(|o| o.params_vocab) } else { 0.0 },
        ln_nonvocab_at_reference: here.params_nonvocab.ln(),
        exponent_nonvocab: exponent(|o| o.params_nonvocab),
        ln_tokens_at_reference: here.tokens.ln(),
        exponent_tokens: exponent(|o| o.tokens),
        // The line through the loss at C0, in log10 C.
        loss_slope_per_decade: slope * excess[1] * LN_10,
        loss_intercept: here.loss - slope * excess[1] * LN_10 * reference.log10(),
        floor: Some(FloorSample { floor: c.floor(), coefficient: excess[1], exponent: -slope }),
    })
}

fn power_laws(
    own: &LawSample,
    samples: &[LawSample],
    form: Form,
    reference: f64,
    n: usize,
) -> PowerLaws {
    type Of = fn(&LawSample) -> (f64, f64);
    let law = |of: Of| {
        let (level, exponent) = of(own);
        let mut law = PowerLaw {
            log10_coefficient: level / LN_10 - exponent * reference.log10(),
            exponent,
            ln_at_reference: level,
            r2: 1.0,
            n,
            ..PowerLaw::default()
        };
        let coefficients: Vec<_> = samples.iter().map(of).collect();
        intervals::of_power(&mut law, &coefficients, reference.ln());
        law
    };
    let all = PowerLaws {
        params_nonvocab: Some(law(LawSample::size)),
        params_vocab: Some(law(LawSample::vocab)),
        tokens: Some(law(LawSample::tokens)),
        ..PowerLaws::default()
    };
    all.under(form.parameters())
}

/// N_v in N_nv, which is a power law everywhere: its exponent is (1 + α1)/(1 + α2).
fn vocabulary(own: &LawSample, parametric: &Parametric) -> PowerLaw {
    let exponent = vocab_exponent(&parametric.coefficients);
    let level = own.ln_vocab_at_reference - exponent * own.ln_nonvocab_at_reference;
    let exponents: Vec<f64> = parametric.bootstrap.iter().map(vocab_exponent).collect();
    PowerLaw {
        log10_coefficient: level / LN_10,
        exponent,
        ln_at_reference: own.ln_vocab_at_reference,
        r2: 1.0,
        exponent_ci95: interval95(&exponents),
        n: parametric.n,
        ..PowerLaw::default()
    }
}

fn floor_law(own: &FloorSample, samples: &[LawSample], parametric: &Parametric) -> FloorLaw {
    let law = FloorLaw {
        floor: own.floor,
        coefficient: own.coefficient,
        exponent: own.exponent,
        r2: parametric.r2,
        aic: parametric.aic,
        n: parametric.n,
        ..FloorLaw::default()
    };
    intervals::of_floor(law, samples)
}
