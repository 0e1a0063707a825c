//! The whole fit: points in, [`Laws`] out.

use super::advice::advise;
use super::bootstrap::{Bootstrap, Replicate, Sources};
use super::budget::group_checked;
use super::cell::Cell;
use super::law_set::{Columns, LawSet, geometric_mean, law_set};
use super::lost_runs::of_lost_runs;
use super::lost_shares::of_lost_shares;
use super::minima::Grid;
use super::noise::{Scatter, run_noise};
use super::select::{flagged_text, hold_out, law_method, usable};
use super::split::Split;
use super::stats::MIN_REPLICATES;
use super::test_split::test_noise;
use super::tokenizer_noise::{runs_beside_tokenizers, tokenizer_noise};
use super::validation::validate;
use super::{
    FitError, FitOptions, FloorLaw, HeldOut, HoldOut, IntervalPart, IsoFlopPoint, Judgement,
    LawKind, LawSample, Laws, LogLaw, LossLaws, Metric, Minimum, Parameters, PowerLaws, RunNoise,
    check, floor_law, intervals, sensitivity, warnings,
};
use crate::laws::MinimumMethod;
use judge::{admissible, interval_parts, judge, misfit};

/// Fits every law to a table of finished runs.
///
/// Runs are grouped by declared budget; the held-out budget is set aside; the minima of the rest
/// are found by each method; those of one method, less the flagged, give N_nv, N_v and D in C, N_v
/// in N_nv, and the two loss laws; the bootstrap gives the intervals; budgets left out give the laws'
/// errors, and the doubts that are left give advice. Nothing is left out without a
/// sentence in [`Laws::warnings`].
///
/// # Errors
/// [`FitError`]; [`FitError::is_unidentifiable`] tells missing data from wrong input. Where too few
/// minima are unflagged, a fit with [`FitOptions::keep_flagged`] still gives laws, for a caller who
/// prefers doubtful ones to none.
pub fn fit(points: &[IsoFlopPoint], options: &FitOptions) -> Result<Laws, FitError> {
    let mut laws = fit_without(points, options)?;
    if options.recommend && laws.held_out.is_some() {
        let law_method = Some(laws.minima_method);
        let of_all = FitOptions { hold_out: HoldOut::None, law_method, ..options.clone() };
        laws.refit = fit_without(points, &of_all).ok().map(Box::new);
    }
    Ok(laws)
}

/// The laws without the held-out budget.
fn fit_without(points: &[IsoFlopPoint], options: &FitOptions) -> Result<Laws, FitError> {
    options.check()?;
    if points.is_empty() {
        return Err(FitError::NoPoints);
    }
    let metric = check::metric(points)?;
    let budgets = group_checked(points, options.parameters)?;
    if points.len() > 3 && 2 * budgets.len() > points.len() {
        return Err(FitError::ScatteredBudgets { rows: points.len(), budgets: budgets.len() });
    }
    let (held_out, hold_out_warning) = hold_out(&budgets, options.hold_out)?;
    let split = Split::new(&budgets, held_out);
    let (options, fewer) = &affordable(options, &split);
    let noise = run_noise(&split.fitted, runs_beside_tokenizers(&budgets));
    let per_method = split.minima_by_method(options, noise);
    let (method, method_warning) = law_method(&per_method, options);
    let used = used_minima(&per_method, method, options)?;

    let tokenizers = tokenizer_noise(&budgets);
    let grids: Vec<&Grid> = split.fitted.iter().chain(&split.held_out).collect();
    let test = test_noise(&grids, noise);
    let scatter = Scatter { noise, tokenizers: tokenizers.as_ref(), test: test.as_ref() };
    let replicas = replicas(&used, &split, &per_method, method, scatter, options);
    let mut laws = laws_through(&used, &split, method, &replicas, options)?;
    laws.metric = metric;
    laws.minima = with_held_out(&per_method, &split, &replicas);
    laws.sensitivity = sensitivity::by_method(&per_method, method, &split, options);
    laws.validation = validate(&used, laws.held_out.as_ref(), &split, options);
    laws.advice = advise(&laws, &split);
    laws.judgement = judge(&laws, &split, &per_method, replicas.parts, scatter, options);
    let all = minima_of(&per_method, method);
    let lost = of_lost_runs(split.fitted.iter().chain(&split.held_out));
    let alone = of_lost_shares(points, &budgets);
    let first =
        [check::repeats(points), alone, hold_out_warning, method_warning, fewer.clone(), lost];
    let first = first.into_iter().flatten();
    let of_minima = warnings::of_minima(all, &used, &split, method, options);
    laws.warnings.splice(0..0, first.chain(of_minima));
    Ok(laws)
}

/// Cells times replicates that a fit computes at most: some ten seconds on one core.
const MOST_WORK: usize = 50_000_000;

/// The options with no more replicates than a large table can afford, and a sentence if fewer.
fn affordable(options: &FitOptions, split: &Split) -> (FitOptions, Option<String>) {
    let of_grid = |grid: &Grid| grid.of_all_shares().map(<[Cell]>::len).sum::<usize>();
    let cells: usize = split.fitted.iter().map(of_grid).sum();
    let bootstrap = options.bootstrap.min((MOST_WORK / cells.max(1)).max(2 * MIN_REPLICATES));
    let fewer = (bootstrap < options.bootstrap).then(|| {
        format!(
            "The table has {cells} cells, so {bootstrap} bootstrap replicates are made instead of \
             {}.",
            options.bootstrap
        )
    });
    (FitOptions { bootstrap, ..options.clone() }, fewer)
}

/// The noise of the runs, and the bootstrap that it drives.
struct Replicas {
    noise: Option<RunNoise>,
    replicates: Vec<Replicate>,
    parts: Vec<IntervalPart>,
}

fn replicas(
    used: &[Minimum],
    split: &Split,
    per_method: &[(MinimumMethod, Vec<Minimum>)],
    method: MinimumMethod,
    Scatter { noise, tokenizers, test }: Scatter,
    options: &FitOptions,
) -> Replicas {
    let methods: Vec<MinimumMethod> = per_method.iter().map(|(method, _)| *method).collect();
    let reference = geometric_mean(&Columns::new(used, &split.fitted, options).compute);
    let known = noise.filter(|noise| !noise.is_rounding(&split.fitted));
    let bootstrap = |noise| Bootstrap {
        split,
        methods: &methods,
        method,
        used,
        reference,
        noise,
        tokenizers,
        test,
        misfit: misfit(method, split, noise),
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

/// The minima of one method.
fn minima_of(per_method: &[(MinimumMethod, Vec<Minimum>)], method: MinimumMethod) -> &[Minimum] {
    let found = per_method.iter().find(|(m, _)| *m == method);
    found.map(|(_, minima)| minima.as_slice()).expect("the laws' method is always computed")
}

/// The minima to fit.
///
/// # Errors
/// [`FitError::TooFewMinima`] for fewer than two.
fn used_minima(
    per_method: &[(MinimumMethod, Vec<Minimum>)],
    method: MinimumMethod,
    options: &FitOptions,
) -> Result<Vec<Minimum>, FitError> {
    let all = minima_of(per_method, method);
    let used = usable(all, options);
    if used.len() < 2 {
        return Err(too_few_minima(method, used.len(), flagged_text(all)));
    }
    Ok(used)
}

fn too_few_minima(method: MinimumMethod, usable: usize, flagged: String) -> FitError {
    FitError::TooFewMinima { method, usable, flagged }
}

/// Every law, interval and held-out error; the minima and the sensitivity table are still empty, and
/// the metric is the default.
fn laws_through(
    used: &[Minimum],
    split: &Split,
    method: MinimumMethod,
    replicas: &Replicas,
    options: &FitOptions,
) -> Result<Laws, FitError> {
    let columns = Columns::new(used, &split.fitted, options);
    let reference = geometric_mean(&columns.compute);
    let set = law_set(&columns, reference, options).ok_or_else(|| {
        too_few_minima(method, used.len(), "none, but they spend the same".into())
    })?;
    let replicates = intervals::laws(&replicas.replicates);
    let floor = floor_law(&columns.compute, &columns.loss, reference);
    let samples: Vec<LawSample> = replicates.iter().map(|replicate| replicate.sample).collect();
    let floor = floor.map(|law| intervals::of_floor(law, &samples));
    let held_out = split.held_out_minimum(method, replicas.noise);

    let mut warnings: Vec<String> = warnings::of_held_out(held_out.as_ref()).into_iter().collect();
    warnings.extend(warnings::of_floor(floor.as_ref(), used.len()));
    warnings.extend(warnings::of_bootstrap(
        replicas.noise,
        &split.fitted,
        replicates.len(),
        options,
    ));
    let set = intervals::of_set(set, &replicates, reference);
    let loss = loss_laws(set.loss.clone(), floor, held_out.as_ref(), reference);
    let has_vocab_law = split.n_vocabularies() > 1;
    Ok(Laws {
        name: options.name.clone(),
        law: LawKind::Isoflop,
        from_sweep: false,
        flops_rule: options.flops_rule.clone(),
        metric: Metric::default(),
        parameters: options.parameters,
        n_ctx: None,
        head_share: None,
        reference_flops: reference,
        fitted_budgets: used.iter().map(|m| m.budget_flops).collect(),
        minima_method: method,
        minima: Vec::new(),
        held_out,
        power_laws: power_laws(set.clone(), has_vocab_law, options),
        vocab_from_nonvocab: set.vocab_from_nonvocab.filter(|_| has_vocab_law),
        loss,
        parametric: None,
        sensitivity: Vec::new(),
        validation: Vec::new(),
        advice: Vec::new(),
        noise: replicas.noise,
        bootstrap: samples,
        warnings,
        judgement: Judgement::default(),
        refit: None,
    })
}

/// The laws under the names of what they are laws of.
fn power_laws(set: LawSet, has_vocab_law: bool, options: &FitOptions) -> PowerLaws {
    let size = Some(set.params_nonvocab);
    let (params, params_nonvocab) = match options.parameters {
        Parameters::Split => (None, size),
        Parameters::Total => (size, None),
    };
    PowerLaws {
        params,
        params_vocab: set.params_vocab.filter(|_| has_vocab_law),
        params_nonvocab,
        tokens: Some(set.tokens),
    }
}

/// Both loss laws with what they predict at the held-out budget, less what was measured there.
fn loss_laws(
    log: LogLaw,
    floor: Option<FloorLaw>,
    held_out: Option<&HeldOut>,
    reference: f64,
) -> LossLaws {
    let there = held_out.map(|h| (h.minimum.budget_flops, h.minimum.loss_normalised));
    let log_error = there.map(|(c, measured)| log.loss_at(c) - measured);
    let floor = floor.map(|law| FloorLaw {
        held_out_error: there.map(|(c, measured)| law.loss_at(c, reference) - measured),
        ..law
    });
    LossLaws { log: Some(LogLaw { held_out_error: log_error, ..log }), floor }
}

/// Every minimum by every method with its intervals, the held-out budget's in its place among the
/// others.
fn with_held_out(
    per_method: &[(MinimumMethod, Vec<Minimum>)],
    split: &Split,
    replicas: &Replicas,
) -> Vec<Minimum> {
    let Replicas { noise, replicates, .. } = replicas;
    let mut index = 0..;
    let mut of_method = |(method, minima): &(MinimumMethod, Vec<Minimum>)| {
        let held_out = split.held_out_minimum(*method, *noise).map(|held_out| held_out.minimum);
        let all = minima.iter().cloned().chain(held_out).zip(&mut index);
        let all = all.map(|(minimum, i)| intervals::of_minimum(minimum, i, replicates));
        let mut all: Vec<Minimum> = all.collect();
        all.sort_by(|a, b| a.budget_flops.total_cmp(&b.budget_flops));
        all
    };
    per_method.iter().flat_map(&mut of_method).collect()
}

#[cfg(test)]
mod degenerate;
mod judge;
#[cfg(test)]
mod tests;
