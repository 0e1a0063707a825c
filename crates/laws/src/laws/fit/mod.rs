//! The whole fit: points in, [`Laws`] out.

mod approach1;
mod frontier;
mod judge;
mod parametric_laws;
mod telling;
#[cfg(test)]
mod tests;

pub use approach1::approach1;
pub use frontier::{FrontierPoint, frontier};
pub use judge::sensitivity_row;
pub use parametric_laws::{around, fit_parametric, parametric_laws};

use self::judge::{admissible, interval_parts, judge, sensitivity};
use crate::laws::advice::advise;
use crate::laws::file::{HeldOut, IntervalPart, LawKind, Laws};
use crate::laws::input::{
    FitError, FitOptions, HoldOut, IsoFlopPoint, MinimumMethod, Parameters, group_checked,
    lost_shares, metric_of, repeats,
};
use crate::laws::lines::{
    Bootstrap, Columns, Exponents, LawSet, LossLaws, Replicate, ReplicateLaws, Sources, law_set,
    minima_with_intervals, validate,
};
use crate::laws::maths::stats::{MIN_REPLICATES, extent, geometric_mean};
use crate::laws::minima::{
    ByMethod, Grid, Minimum, RunNoise, hold_out, lack_of_fit, law_method, lost_runs,
    minima_by_method, n_vocabularies, tell_laws, usable,
};
use crate::laws::noise::{Scatter, run_noise, runs_beside_tokenizers, test_noise, tokenizer_noise};
use crate::laws::say::{flagged, warnings};

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
    Laws {
        metric: points.first().map(|point| point.metric.clone()).unwrap_or_default(),
        fitted_budgets: if least < most { vec![least, most] } else { vec![most] },
        ..Laws::unfitted(law, names, parameters, reference_flops)
    }
}
