//! The whole fit: points in, [`Laws`] out.

mod approach1;
mod chance;
mod judge;
#[cfg(test)]
mod tests;

pub use approach1::{FrontierPoint, approach1, frontier};
pub use judge::sensitivity_row;

use self::chance::{Place, losses_tell, rises, sizes_tell, vocab_is_chance};
use self::judge::{admissible, interval_parts, judge, sensitivity};
use crate::laws::advice::advise;
use crate::laws::file::{HeldOut, IntervalPart, Judgement, LawKind, Laws};
use crate::laws::input::{
    FitError, FitOptions, HoldOut, IsoFlopPoint, MinimumMethod, Parameters, group_checked,
    lost_shares, metric_of, repeats,
};
use crate::laws::lines::{
    Bootstrap, Columns, Exponents, FloorLaw, FloorSample, LawSample, LawSet, LossLaws, PowerLaw,
    PowerLaws, Replicate, ReplicateLaws, Sources, law_set, minima_with_intervals, validate,
};
use crate::laws::maths::stats::{MIN_REPLICATES, extent, geometric_mean, interval95};
use crate::laws::minima::{
    ByMethod, Grid, Minimum, Optimum, RunNoise, hold_out, lack_of_fit, law_method, lost_runs,
    minima_by_method, n_vocabularies, tell_laws, usable,
};
use crate::laws::noise::{Scatter, run_noise, runs_beside_tokenizers, test_noise, tokenizer_noise};
use crate::laws::parametric::{
    Coefficients, Finding, Form, Parametric, ParametricOptions, fitted, optimum, vocab_exponent,
};
use crate::laws::say::warnings::of_lost_optima;
use crate::laws::say::{flagged, warnings};
use std::f64::consts::LN_10;

/// Cells times replicates that a fit computes at most: some ten seconds on one core.
const MOST_WORK: usize = 50_000_000;

/// Fits every law to a table of finished runs.
///
/// Runs are grouped by declared budget, and the minima of all budgets are found by each method. Those of
/// one method, less the flagged, give N_nv, N_v and D in C, N_v in N_nv, and the two loss laws; one smooth
/// loss goes through all cells. The bootstrap gives the intervals. Laws through fewer budgets are tested on
/// the others, and the one that misses least is recommended. Nothing is left out without a sentence in
/// [`Laws::warnings`].
///
/// # Errors
/// [`FitError`]; [`FitError::is_unidentifiable`] tells missing data from wrong input. Where too few
/// minima are unflagged and the cells are too few for a smooth loss, a fit with
/// [`FitOptions::keep_flagged`] may still give laws, for a caller who prefers doubtful ones to none.
pub fn fit(points: &[IsoFlopPoint], options: &FitOptions) -> Result<Laws, FitError> {
    options.check()?;
    if points.is_empty() {
        return Err(FitError::NoPoints);
    }
    let metric = metric_of(points)?;
    let budgets = group_checked(points, options.parameters)?;
    if points.len() > 3 && 2 * budgets.len() > points.len() {
        return Err(FitError::ScatteredBudgets { rows: points.len(), budgets: budgets.len() });
    }
    let held_out = hold_out(&budgets, options.hold_out)?;
    let grids: Vec<Grid> = budgets.iter().filter_map(Grid::new).collect();
    if !options.keep_flagged {
        sizes_tell(&Place::of_cells(&grids))?;
    }
    let (asked, cells) =
        (options.bootstrap, grids.iter().flat_map(Grid::of_all_shares).flatten().count());
    // No more replicates than a table of so many cells can afford.
    let bootstrap = asked.min((MOST_WORK / cells.max(1)).max(2 * MIN_REPLICATES));
    let options = &FitOptions { bootstrap, ..options.clone() };
    let noise = run_noise(&grids, runs_beside_tokenizers(&budgets));
    let per_method = minima_by_method(&grids, options, noise);
    let method = law_method(&per_method, options);
    let own = per_method.iter().find(|(m, _)| *m == method);
    let all = own.map(|(_, minima)| &minima[..]).expect("the laws' method is always computed");
    let used = usable(all, options);

    let tokenizers = tokenizer_noise(&budgets);
    let test = test_noise(&grids, noise);
    let scatter = Scatter { noise, tokenizers: tokenizers.as_ref(), test: test.as_ref() };
    let replicas = replicas(&used, &grids, &per_method, method, scatter, options);
    let mut laws = laws_through(&used, &grids, method, &replicas, options);
    laws.metric = metric;
    let minima = per_method.iter().flat_map(|(_, minima)| minima.iter().cloned());
    laws.minima = minima_with_intervals(minima, &replicas.replicates);
    if let Some(index) = held_out {
        test_on(&mut laws, grids[index].budget_flops, &used, &grids, options);
    }
    laws.sensitivity = sensitivity(&per_method, method, &grids, options);
    laws.validation = validate(&used, &grids, options);
    laws.advice = advise(&laws, &grids);
    laws.judgement = judge(&laws, &grids, &per_method, replicas.parts, scatter, options);
    laws.judgement.vocab_is_chance = vocab_is_chance(&Place::of_cells(&grids));
    if laws.power_laws.tokens.is_none() && laws.judgement.joint.is_none() {
        let flagged = flagged(all);
        return Err(FitError::TooFewMinima { method, usable: used.len(), flagged });
    }
    let none_held_out = held_out.is_none() && options.hold_out == HoldOut::LargestBudget;
    let first = [
        repeats(points).map(warnings::of_repeats),
        warnings::of_lost_shares(&lost_shares(points, &budgets)),
        none_held_out.then(|| warnings::NOTHING_HELD_OUT.to_string()),
        warnings::of_method(method, &per_method, options),
        warnings::of_cost(cells, options.bootstrap, asked),
        warnings::of_lost_runs(&lost_runs(grids.iter())),
    ];
    let first = first.into_iter().flatten();
    let of_minima = warnings::of_minima(all, &used, &grids, method, options);
    laws.warnings.splice(0..0, first.chain(of_minima));
    Ok(laws.answered())
}

/// The noise of the runs, and the bootstrap that it drives.
struct Replicas {
    noise: Option<RunNoise>,
    replicates: Vec<Replicate>,
    parts: Vec<IntervalPart>,
}

fn replicas(
    used: &[Minimum],
    grids: &[Grid],
    per_method: &ByMethod,
    method: MinimumMethod,
    Scatter { noise, tokenizers, test }: Scatter,
    options: &FitOptions,
) -> Replicas {
    let methods: Vec<MinimumMethod> = per_method.iter().map(|(method, _)| *method).collect();
    let reference = reference_of(used, grids);
    let known = noise.filter(|noise| !noise.is_rounding(grids));
    let bootstrap = |noise| Bootstrap {
        grids,
        methods: &methods,
        method,
        used,
        reference,
        noise,
        tokenizers,
        test,
        misfit: lack_of_fit(method, grids, noise).map_or(1.0, |lack| lack.variance_ratio()),
        admissible: admissible(per_method, method, used, options),
        sources: Sources::ALL,
        options,
    };
    let bootstrap = known.map(bootstrap);
    let replicates = bootstrap.as_ref().map(Bootstrap::replicates).unwrap_or_default();
    let parts = bootstrap.filter(|_| options.recommend && options.bootstrap > 0);
    let parts = parts.as_ref().map(interval_parts).unwrap_or_default();
    Replicas { noise, replicates, parts }
}

/// C0: the middle of the budgets whose minima are used, or of all where none is.
fn reference_of(used: &[Minimum], grids: &[Grid]) -> f64 {
    let of_used: Vec<f64> = used.iter().map(|minimum| minimum.budget_flops).collect();
    let all = || grids.iter().map(|grid| grid.budget_flops).collect();
    geometric_mean(&if of_used.is_empty() { all() } else { of_used })
}

/// Every law and interval through some minima; the minima and the sensitivity table are still empty, and
/// the metric is the default. Where the minima are too few there are no laws through them.
fn laws_through(
    used: &[Minimum],
    grids: &[Grid],
    method: MinimumMethod,
    replicas: &Replicas,
    options: &FitOptions,
) -> Laws {
    let columns = Columns::new(used, grids, options);
    let reference = reference_of(used, grids);
    // Who asks for flagged minima gets the laws through them; the answer does not rest on these.
    let told = tell_laws(used) || options.keep_flagged;
    let replicates: Vec<ReplicateLaws> =
        replicas.replicates.iter().filter_map(|replicate| replicate.laws).collect();
    let set = law_set(&columns, reference, options).filter(|_| told);
    let set = set.map(|set| set.with_intervals(&replicates));
    let floor = set.as_ref().and_then(|set| set.floor.as_ref());
    let mut warnings: Vec<String> = warnings::of_floor(floor, used.len()).into_iter().collect();
    warnings.extend(warnings::of_bootstrap(replicas.noise, grids, replicates.len(), options));
    let names = (options.name.as_str(), options.flops_rule.as_str());
    let samples = replicates.iter().filter(|_| told).map(|replicate| replicate.sample);
    let mut laws = Laws {
        fitted_budgets: used.iter().map(|m| m.budget_flops).collect(),
        minima_method: method,
        noise: replicas.noise,
        bootstrap: samples.collect(),
        warnings,
        ..Laws::unfitted(LawKind::Isoflop, names, options.parameters, reference)
    };
    if let Some(set) = set {
        fill(&mut laws, set, n_vocabularies(grids) > 1);
    }
    laws
}

/// Writes every law of a set, those of N_v only if `several` vocabularies were tried.
fn fill(laws: &mut Laws, set: LawSet, several: bool) {
    laws.power_laws = set.powers(several, laws.parameters);
    laws.vocab_from_nonvocab = set.vocab_from_nonvocab.filter(|_| several);
    laws.loss = LossLaws { log: Some(set.log), floor: set.floor };
}

/// The errors at one budget of the laws through the other minima.
fn test_on(laws: &mut Laws, budget: f64, used: &[Minimum], grids: &[Grid], options: &FitOptions) {
    let own = laws.own_minima().find(|m| m.budget_flops == budget);
    let Some(minimum) = own.cloned() else { return };
    laws.warnings.extend(warnings::of_held_out(&minimum));
    let others: Vec<Minimum> =
        used.iter().filter(|minimum| minimum.budget_flops != budget).cloned().collect();
    let without = LawSet::through(&others, grids, options);
    let measured = minimum.loss_normalised;
    if let (Some(law), Some(without)) = (&mut laws.loss.log, &without) {
        law.held_out_error = Some(without.log.loss_at(budget) - measured);
    }
    if let (Some(law), Some(without)) = (&mut laws.loss.floor, &without) {
        law.held_out_error =
            without.floor.as_ref().map(|floor| floor.loss_at(budget, without.reference) - measured);
    }
    let exponents = without.as_ref().map(Exponents::of).unwrap_or_default();
    laws.held_out = Some(HeldOut { budget_flops: budget, minimum, exponents });
}

/// The laws of a table before anything was fitted, around C0 = `reference_flops`; the budgets they
/// speak of are the least and the greatest that the table holds.
fn unfitted(
    law: LawKind,
    names: (&str, &str),
    parameters: Parameters,
    reference_flops: f64,
    points: &[IsoFlopPoint],
) -> Laws {
    let [least, most] = extent(points.iter().map(|p| p.flops));
    let metric = points.first().map(|point| point.metric.clone()).unwrap_or_default();
    let places = Place::of_runs(points);
    Laws {
        judgement: Judgement {
            vocab_is_chance: vocab_is_chance(&places),
            rows: rises(&places, &metric).into_iter().collect(),
            ..Judgement::default()
        },
        metric,
        fitted_budgets: if least < most { vec![least, most] } else { vec![most] },
        ..Laws::unfitted(law, names, parameters, reference_flops)
    }
}

// The laws of the optimum that follow from a parametric loss.
//
// For approach 3 they are exact: N and D are powers of C, and the loss at the optimum is a power
// law with the floor E. With a vocabulary they are the tangents at C0; a prediction elsewhere goes
// back to the loss itself.

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
    losses_tell(&Place::of_runs(points))?;
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
