//! The laws of the optimum that follow from a parametric loss.
//!
//! For approach 3 they are exact: N and D are powers of C, and the loss at the optimum is a power
//! law with the floor E. With a vocabulary they are the tangents at C0; a prediction elsewhere goes
//! back to the loss itself.

use super::telling::losses_tell;
use super::unfitted;
use crate::laws::file::{LawKind, Laws};
use crate::laws::input::{FitError, IsoFlopPoint, Parameters};
use crate::laws::lines::{FloorLaw, FloorSample, LawSample, PowerLaw, PowerLaws};
use crate::laws::maths::stats::{geometric_mean, interval95};
use crate::laws::minima::Optimum;
use crate::laws::parametric::{
    Coefficients, Finding, Form, Parametric, ParametricOptions, fitted, optimum, vocab_exponent,
};
use crate::laws::say::warnings::of_lost_optima;
use std::f64::consts::LN_10;

/// Fits a parametric law: the global optimum, its uncertainty, and doubts.
///
/// # Errors
/// [`FitError::BadValue`], [`FitError::BadLoss`], [`FitError::Metrics`] and [`FitError::BadOption`] for
/// wrong input, [`FitError::NotIdentified`] if the rows cannot determine the coefficients, or tell no law.
pub fn fit_parametric(
    points: &[IsoFlopPoint],
    options: &ParametricOptions,
) -> Result<Parametric, FitError> {
    let (own, findings) = fitted(points, options)?;
    losses_tell(points)?;
    let size = options.form.quantities()[0];
    let of_rows = own.influence.as_ref().map(|influence| influence.sentence(size));
    let warnings = findings.iter().map(Finding::sentence).chain(of_rows).collect();
    Ok(Parametric { warnings, ..own })
}

/// Half the step in ln C over which exponents are read off.
const HALF_STEP: f64 = 0.01;

/// The laws implied by `parametric`, fitted to `points`; others are absent.
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

/// The same laws as tangents at another C0; laws without a parametric loss are unchanged.
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

/// The laws around C0 of one replicate; `None` if the coefficients have no optimum.
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
        law.set_intervals(&coefficients, reference.ln());
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
    law.with_intervals(&samples.iter().filter_map(|sample| sample.floor).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::parametric::tests::{
        chinchilla, chinchilla_runs, motion, motion_runs, run, without_intervals,
    };
    use crate::laws::parametric::{Huber, Space, Starts};
    use proptest::prelude::*;

    fn close(found: &Coefficients, truth: &Coefficients, relative: f64) {
        for ((found, truth), name) in
            found.values().iter().zip(truth.values()).zip(truth.form.names())
        {
            assert!((found / truth - 1.0).abs() < relative, "{name}: {found} for {truth}");
        }
    }

    #[test]
    fn both_laws_are_recovered_from_their_own_losses() {
        let fit = fit_parametric(&chinchilla_runs(9, 0.0, 0), &without_intervals(Form::Approach3));
        close(&fit.unwrap().coefficients, &chinchilla(), 1e-5);
        let fit = fit_parametric(&motion_runs(0.0, 0), &without_intervals(Form::Approach3Vocab));
        close(&fit.unwrap().coefficients, &motion(), 1e-5);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn any_law_is_recovered_in_either_space(
            e in 0.5..3.0f64, alpha in 0.15..0.8f64, beta in 0.15..0.8f64, raw in any::<bool>(),
        ) {
            // Coefficients that give each term a share of the loss in the middle of the runs.
            let (a, b) = ((1e9f64).powf(alpha) * 0.4, (2e10f64).powf(beta) * 0.4);
            let truth = Coefficients::new(Form::Approach3, &[e, a, b, alpha, beta]).unwrap();
            let runs = chinchilla_runs(9, 0.0, 0);
            let runs: Vec<IsoFlopPoint> =
                runs.iter().map(|p| run(&truth, [p.params_nonvocab, 0.0, p.tokens], 0.0)).collect();
            let space = if raw { Space::Raw } else { Space::Log };
            let options = ParametricOptions { space, ..without_intervals(Form::Approach3) };
            close(&fit_parametric(&runs, &options).unwrap().coefficients, &truth, 1e-3);
        }
    }

    #[test]
    fn a_normalised_loss_has_a_floor_below_zero() {
        let mut runs = chinchilla_runs(9, 0.0, 0);
        runs.iter_mut().for_each(|run| run.loss -= 6.0);
        let options = ParametricOptions { space: Space::Raw, ..without_intervals(Form::Approach3) };
        let fit = fit_parametric(&runs, &options).unwrap();
        assert!((fit.coefficients.floor() + 4.2).abs() < 1e-4, "{:?}", fit.coefficients);
        assert!((fit.coefficients.exponent(0) - 0.35).abs() < 1e-4, "{:?}", fit.coefficients);
    }

    #[test]
    fn wild_runs_hardly_move_a_robust_fit() {
        let mut runs = chinchilla_runs(9, 0.002, 1);
        for run in runs.iter_mut().step_by(11) {
            run.loss *= 1.3;
        }
        let exponent = |huber| {
            let options = ParametricOptions { huber, ..without_intervals(Form::Approach3) };
            fit_parametric(&runs, &options).unwrap().coefficients.exponent(0)
        };
        let miss = |huber| (exponent(huber) - chinchilla().exponent(0)).abs();
        assert!(miss(Huber::Mad(1.345)) < 0.03, "{}", miss(Huber::Mad(1.345)));
        assert!(miss(Huber::None) > 2.0 * miss(Huber::Mad(1.345)));
    }

    #[test]
    fn both_kinds_of_start_end_at_the_same_optimum() {
        let runs = chinchilla_runs(7, 0.01, 2);
        let fit = |starts| {
            // A given δ: that of the MAD would differ in its tenth digit.
            let huber = Huber::Delta(1e-3);
            let options = ParametricOptions { starts, huber, ..without_intervals(Form::Approach3) };
            fit_parametric(&runs, &options).unwrap()
        };
        let (few, many) = (fit(Starts::Projected), fit(Starts::Grid));
        assert_eq!((few.starts, many.starts), (16, 4500));
        assert!((few.objective / many.objective - 1.0).abs() < 1e-9);
        assert!(few.starts_at_optimum > 8 && many.starts_at_optimum > 1000, "{many:?}");
        assert!(few.gradient_norm < 1e-4 * few.objective_sum, "{}", few.gradient_norm);
    }

    #[test]
    fn units_change_the_coefficients_and_nothing_else() {
        let runs = chinchilla_runs(7, 0.01, 3);
        let scaled: Vec<IsoFlopPoint> = runs
            .iter()
            .map(|p| IsoFlopPoint {
                params_nonvocab: p.params_nonvocab * 1e-6,
                tokens: p.tokens * 1e-9,
                ..p.clone()
            })
            .collect();
        let fit = |runs: &[IsoFlopPoint]| {
            fit_parametric(runs, &without_intervals(Form::Approach3)).unwrap().coefficients
        };
        let (units, millions) = (fit(&runs), fit(&scaled));
        for term in [0, 1] {
            let scale = [1e6f64, 1e9][term].powf(units.exponent(term));
            assert!((units.exponent(term) - millions.exponent(term)).abs() < 1e-6);
            assert!(
                (units.coefficient(term) / scale / millions.coefficient(term) - 1.0).abs() < 1e-5
            );
        }
    }

    #[test]
    fn a_run_of_weight_two_counts_like_two_runs() {
        let mut runs = chinchilla_runs(7, 0.01, 4);
        let twice = [runs.clone(), vec![runs[5].clone()]].concat();
        runs[5].weight = 2.0;
        let fit = |runs: &[IsoFlopPoint]| {
            let options = ParametricOptions {
                huber: Huber::Delta(1e-2),
                ..without_intervals(Form::Approach3)
            };
            fit_parametric(runs, &options).unwrap().coefficients
        };
        close(&fit(&runs), &fit(&twice), 1e-6);
    }

    #[test]
    fn the_laws_of_a_parametric_loss_are_those_of_its_optima() {
        let runs = motion_runs(0.0, 0);
        let fit = fit_parametric(&runs, &without_intervals(Form::Approach3Vocab)).unwrap();
        let laws = parametric_laws(&runs, fit, "motion", "6nd");
        let at = |c: f64| optimum(&motion(), c).unwrap();
        let c0 = laws.reference_flops;
        let law = |law: &Option<PowerLaw>, c: f64| law.as_ref().unwrap().value_at(c);
        assert!(
            (law(&laws.power_laws.params_nonvocab, c0) / at(c0).params_nonvocab - 1.0).abs() < 1e-3
        );
        assert!((law(&laws.power_laws.params_vocab, c0) / at(c0).params_vocab - 1.0).abs() < 1e-3);
        // Far away the tangent is off; read there it is exact again.
        let there = around(&laws, 1e21);
        let exact = at(1e21).params_vocab;
        assert!((law(&there.power_laws.params_vocab, 1e21) / exact - 1.0).abs() < 1e-3);
        let gamma = laws.vocab_from_nonvocab.unwrap().exponent;
        assert!((gamma - 1.35 / 1.22).abs() < 1e-4, "{gamma}");
    }

    #[test]
    fn a_parametric_law_survives_its_file() {
        let options = ParametricOptions { bootstrap: 50, ..ParametricOptions::of(Form::Approach3) };
        let fit = fit_parametric(&chinchilla_runs(5, 0.01, 5), &options).unwrap();
        let json = serde_json::to_value(&fit).unwrap();
        for key in ["/form", "/E", "/A", "/alpha", "/se/A", "/ci95/beta/1", "/starts_at_optimum"] {
            assert!(json.pointer(key).is_some_and(|value| !value.is_null()), "{key}");
        }
        assert_eq!(serde_json::from_value::<Parametric>(json).unwrap(), fit);
    }
}
