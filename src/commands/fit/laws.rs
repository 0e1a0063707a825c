//! The laws of the points, by the law that was asked for.

use isoflop::laws;
use isoflop::laws::MinimumMethod;
use isoflop::laws::{
    FitError, FitOptions, Form, Judgement, LawKind, Laws, Parameters, ParametricOptions, Space,
    fit_parametric, parametric_laws,
};

use super::args::FitArgs;
use super::source::{OwnSweep, Source};
use super::sweep;

/// Replicates where neither the command line nor a sweep's file asks for a number.
const BOOTSTRAP: usize = 1000;

/// Fits the law that was asked for.
pub fn laws(source: &Source, request: &FitArgs) -> Result<Laws, FitError> {
    let laws = match (request.law(), &source.sweep) {
        (LawKind::Isoflop, Some(own)) => of_sweep(own, request),
        (LawKind::Isoflop, None) => of_budgets(source, request),
        (LawKind::Approach1, _) => approach1(source, request),
        (LawKind::Parametric(form), _) => parametric(source, request, form),
        (LawKind::Published, _) => unreachable!("no law that can be asked for"),
    }?;
    let laws = match (&source.sweep, request.law()) {
        // The laws of a sweep's own kind know its models already.
        (Some(own), law) if law != LawKind::Isoflop => sweep::of_own_models(laws, &own.records),
        _ => laws,
    };
    Ok(match &source.rows.doubts[..] {
        [] => laws,
        doubts => {
            let judgement =
                Judgement { rows: [doubts, &laws.judgement.rows].concat(), ..laws.judgement };
            Laws { judgement, ..laws }.answered()
        }
    })
}

fn of_sweep(own: &OwnSweep, request: &FitArgs) -> Result<Laws, FitError> {
    sweep::fit_records(&own.records, &sweep::overridden(sweep::options(&own.sweep), request))
}

fn of_budgets(source: &Source, request: &FitArgs) -> Result<Laws, FitError> {
    if !source.rows.budget_declared {
        return Err(FitError::NoBudgets);
    }
    let mut methods = vec![
        MinimumMethod::Argmin,
        MinimumMethod::Parabola,
        MinimumMethod::Cubic,
        MinimumMethod::Akima,
    ];
    if source.rows.parameters == Parameters::Split {
        methods.push(MinimumMethod::Surface);
    }
    let options = sweep::asked(FitOptions { methods, ..named(source) }, request);
    laws::fit(&source.rows.points, &options)
}

fn named(source: &Source) -> FitOptions {
    FitOptions {
        name: source.name.clone(),
        flops_rule: source.rule.name().to_string(),
        parameters: source.rows.parameters,
        ..FitOptions::default()
    }
}

fn approach1(source: &Source, request: &FitArgs) -> Result<Laws, FitError> {
    let options = FitOptions {
        huber: request.huber_mads(),
        bootstrap: request.bootstrap.unwrap_or(BOOTSTRAP),
        seed: request.seed.unwrap_or(0),
        ..named(source)
    };
    laws::approach1(&laws::of_largest_share(&source.rows.points), &options)
}

fn parametric(source: &Source, request: &FitArgs, form: Form) -> Result<Laws, FitError> {
    if form.parameters() == Parameters::Split && source.rows.parameters == Parameters::Total {
        return Err(FitError::NotIdentified(format!(
            "{} needs N_nv and N_v apart: name params_nonvocab, and params_vocab or n_vocab and \
             d_model, in --columns",
            form.name()
        )));
    }
    let points = laws::of_largest_share(&source.rows.points);
    let budgets = points.iter().map(|point| point.budget_flops).reduce(f64::max);
    let influence_at = request.budgets(budgets).into_iter().reduce(f64::max);
    let mut options = ParametricOptions { influence_at, ..request.parametric(form) };
    let raw_note = request.raw_note(&source.rows.points);
    if raw_note.is_some() {
        options.space = Space::Raw;
    }
    let parametric = fit_parametric(&points, &options)?;
    let mut laws = parametric_laws(&points, parametric, &source.name, source.rule.name());
    laws.warnings.extend(raw_note);
    Ok(laws)
}
