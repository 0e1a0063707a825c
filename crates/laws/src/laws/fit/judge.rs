//! Judges a fit: run noise, misfit of curves, the recommended law, and the exponents under other choices.

use super::chance::{Place, rises};
use crate::laws::file::{IntervalPart, Judgement, Laws, Tried};
use crate::laws::input::{Cell, FitOptions, MinimumMethod, Parameters};
use crate::laws::joint::{JointLaw, fit_joint, repeat, replicates};
use crate::laws::lines::{Bootstrap, LawSample, LawSet, PowerLaws, Sensitivity, Sources};
use crate::laws::maths::stats::{extent, interval95, standard_deviation};
use crate::laws::minima::{
    ByMethod, Grid, Minimum, RunNoise, lack_of_fit, loss_unit, n_vocabularies, of_grids, usable,
};
use crate::laws::noise::Scatter;
use crate::laws::ranking::{Candidate, ForecastError, Recommended, Rows, shares};
use crate::laws::say::warnings::{of_flat, of_spend};
use crate::laws::say::why_recommended;

/// Most replicates of the joint law: each is a whole fit.
const JOINT_REPLICATES: usize = 200;
/// Replicates for each part of an interval.
const PART_REPLICATES: usize = 100;

/// The recommended law, and its reliability.
pub(super) fn judge(
    laws: &Laws,
    grids: &[Grid],
    per_method: &ByMethod,
    interval_parts: Vec<IntervalPart>,
    scatter: Scatter,
    options: &FitOptions,
) -> Judgement {
    let methods = per_method.iter().map(|(method, _)| *method);
    let misfit = |method| lack_of_fit(method, grids, scatter.noise?);
    let rows = [
        rises(&Place::of_cells(grids), &laws.metric),
        unequal_spend(grids),
        flat(grids, scatter.noise),
    ];
    let own = Judgement {
        lack_of_fit: methods.filter_map(misfit).collect(),
        tokenizer_noise: scatter.tokenizers.cloned(),
        test_noise: scatter.test.cloned(),
        interval_parts,
        tried: Some(tried(grids)),
        rows: rows.into_iter().flatten().collect(),
        ..Judgement::default()
    };
    if !options.recommend {
        return own;
    }
    let minima: Vec<Minimum> = laws.own_minima().cloned().collect();
    let shares = shares(grids, (laws.minima_method, &minima), scatter.noise, options);
    let rows = Rows { grids, shares, noise: scatter.noise, options };
    let mut joint = fit_joint(grids, scatter.noise, repeat(grids));
    let recommended = rank(&rows, laws, joint.as_ref());
    let misses = recommended.scores.first().map_or(&[][..], |best| &best.misses);
    // Needed for models that are not optimal and for repeated data even if another law is recommended.
    if let Some(joint) = &mut joint {
        let count = options.bootstrap.min(JOINT_REPLICATES);
        joint.bootstrap = replicates(joint, grids, (scatter, options.seed), count);
    }
    Judgement {
        forecast_error: Some(ForecastError::of(misses, loss_unit(grids))),
        joint,
        recommended: Some(recommended),
        ..own
    }
}

/// The kinds of curve whose minima are all usable wherever the laws' method has usable ones; only that method if it is
/// the best run.
pub(super) fn admissible(
    per_method: &ByMethod,
    own: MinimumMethod,
    used: &[Minimum],
    options: &FitOptions,
) -> Vec<usize> {
    let fits = |minima: &[Minimum]| {
        let same = |m: &Minimum| minima.iter().find(|o| o.budget_flops == m.budget_flops);
        used.iter().all(|m| same(m).is_some_and(|m| m.is_usable() || options.keep_flagged))
    };
    let is_curve = |method| method != MinimumMethod::Argmin && own != MinimumMethod::Argmin;
    let all = per_method.iter().enumerate();
    all.filter(|(_, (method, minima))| *method == own || (is_curve(*method) && fits(minima)))
        .map(|(i, _)| i)
        .collect()
}

/// The recommendation over all budgets, given each grid with its measured minimum. If no law could be tested it is
/// the joint law, which forecast best on other tables (`docs/which-law.md`), else the law with a floor, else the log
/// law.
fn rank(rows: &Rows, laws: &Laws, joint: Option<&JointLaw>) -> Recommended {
    let untested = match (joint, &laws.loss.floor) {
        (Some(joint), _) => joint.candidate(),
        (None, Some(_)) => Candidate::Floor,
        (None, None) => Candidate::Log,
    };
    let mut scores = rows.scores();
    // A law of minima that the budgets do not determine predicts nothing.
    scores.retain(|score| score.law.is_joint() || laws.power_laws.tokens.is_some());
    let law = scores.first().map_or(untested, |best| best.law);
    let why = why_recommended(&scores, rows.grids.len(), &laws.metric);
    let loss_unit = loss_unit(rows.grids);
    Recommended { law, minima_method: laws.minima_method, why, scores, loss_unit }
}

/// The intervals of the exponents by each source of error alone.
pub(super) fn interval_parts(bootstrap: &Bootstrap) -> Vec<IntervalPart> {
    let none = Sources::default();
    let parts = [
        ("runs", Sources { runs: true, ..none }, true),
        ("tokenizers", Sources { tokenizers: true, ..none }, bootstrap.tokenizers.is_some()),
        ("misfit", Sources { misfit: true, ..none }, bootstrap.misfit > 1.0),
        ("method", Sources { method: true, ..none }, bootstrap.admissible.len() > 1),
        ("test split", Sources { test: true, ..none }, bootstrap.test.is_some()),
    ];
    let known = parts.into_iter().filter(|(.., known)| *known);
    known.map(|(part, sources, _)| interval_part(part, bootstrap, sources)).collect()
}

fn interval_part(part: &str, bootstrap: &Bootstrap, sources: Sources) -> IntervalPart {
    let count = bootstrap.options.bootstrap.min(PART_REPLICATES);
    let options = FitOptions { bootstrap: count, ..bootstrap.options.clone() };
    let alone = Bootstrap { sources, options: &options, ..bootstrap.clone() };
    let replicates = alone.replicates();
    let samples: Vec<LawSample> =
        replicates.iter().filter_map(|replicate| Some(replicate.laws?.sample)).collect();
    let interval = |of: fn(&LawSample) -> f64| interval95(samples.iter().map(of));
    IntervalPart {
        part: part.to_string(),
        exponent_nonvocab: interval(|s| s.exponent_nonvocab),
        exponent_vocab: interval(|s| s.exponent_vocab),
        exponent_tokens: interval(|s| s.exponent_tokens),
        slope_per_decade: interval(|s| s.loss_slope_per_decade),
    }
}

/// Runs of a budget spend shares of it that differ by no more than this factor.
const EQUAL_SPEND: f64 = 1.2;

/// A sentence for the budget whose runs spend the most unequal shares of it, where these are far apart.
fn unequal_spend(grids: &[Grid]) -> Option<String> {
    let shares = |grid: &Grid| extent(grid.cells.iter().map(|cell| cell.flops / grid.budget_flops));
    let spread = |[least, most]: [f64; 2]| most / least;
    let all = grids.iter().map(|grid| (grid.budget_flops, shares(grid)));
    let (budget, shares) = all.max_by(|a, b| spread(a.1).total_cmp(&spread(b.1)))?;
    (spread(shares) > EQUAL_SPEND).then(|| of_spend(shares, budget))
}

/// Times the noise of a run that the losses of all runs differ by, at least, where they tell anything.
const TELLING: f64 = 2.0;

/// A sentence where the losses are hardly more than noise.
fn flat(grids: &[Grid], noise: Option<RunNoise>) -> Option<String> {
    let losses: Vec<f64> = grids.iter().flat_map(|g| &g.cells).map(|cell| cell.loss).collect();
    let (sd, noise) = (standard_deviation(&losses), noise?.sd);
    (sd < TELLING * noise).then(|| of_flat(sd, noise))
}

/// The extent of some cells.
fn tried(grids: &[Grid]) -> Tried {
    let cells = || grids.iter().flat_map(|grid| &grid.cells);
    let n_layer = cells().next().and_then(|cell| cell.n_layer);
    let unique = cells().filter_map(|cell| cell.unique_tokens);
    let epochs = grids.iter().flat_map(Grid::of_all_shares).flatten().filter_map(Cell::epochs);
    Tried {
        runs: grids.iter().map(|grid| grid.n_runs).sum(),
        n_budgets: grids.len(),
        budgets: extent(grids.iter().map(|grid| grid.budget_flops)),
        sizes: extent(cells().map(|cell| cell.params_nonvocab)),
        vocabularies: extent(cells().map(|cell| cell.n_vocab)),
        n_layer: n_layer.filter(|n| cells().all(|cell| cell.n_layer == Some(*n))),
        unique_tokens: unique.reduce(f64::max),
        epochs: epochs.reduce(f64::max),
    }
}

// The exponents under other choices, one row a choice.

/// The row of laws that were fitted under another convention.
///
/// A table of points carries one FLOP rule, so the rows for other rules come from refits: move the
/// points to equal FLOPs by the other rule ([`slices`](crate::laws::slices())), fit without a bootstrap, and
/// push this row onto [`Laws::sensitivity`] of the main fit.
pub fn sensitivity_row(variant: &str, laws: &Laws) -> Sensitivity {
    let slope = laws.loss.log.as_ref().map(|law| law.slope_per_decade);
    row(variant.to_string(), &laws.power_laws, slope)
}

fn row(variant: String, laws: &PowerLaws, slope_per_decade: Option<f64>) -> Sensitivity {
    let exponents = laws.map(|law| law.exponent);
    Sensitivity {
        variant,
        exponent_vocab: exponents.params_vocab,
        exponent_nonvocab: exponents.params_nonvocab,
        exponent_params: exponents.params,
        exponent_tokens: exponents.tokens,
        slope_per_decade,
    }
}

/// One row per kind of minimum, one with every flagged minimum of `law_method` kept, and one with all parameters as
/// a model's size. A row's numbers are absent if fewer than two budgets have a usable minimum of that kind.
pub(super) fn sensitivity(
    per_method: &ByMethod,
    law_method: MinimumMethod,
    grids: &[Grid],
    options: &FitOptions,
) -> Vec<Sensitivity> {
    let has_vocab_law = n_vocabularies(grids) > 1;
    let row = |variant: String, minima: &[Minimum]| {
        through(variant, (minima, grids), has_vocab_law, options)
    };
    let mut rows: Vec<_> = per_method
        .iter()
        .map(|(method, minima)| row(format!("minima: {method}"), &usable(minima, options)))
        .collect();
    for (method, minima) in per_method.iter().filter(|(method, _)| *method == law_method) {
        if !options.keep_flagged && minima.iter().any(|m| !m.flags.is_empty()) {
            rows.push(row(format!("minima: {method}, flagged kept"), minima));
        }
    }
    rows.extend(
        other_methods(per_method, grids, options).into_iter().map(|(m, used)| row(m, &used)),
    );
    rows.extend(size_with_vocabulary(law_method, grids, options));
    rows
}

/// Akima's spline and the surface, if not asked for and two budgets have one.
fn other_methods(
    per_method: &ByMethod,
    grids: &[Grid],
    options: &FitOptions,
) -> Vec<(String, Vec<Minimum>)> {
    let asked = |method: &MinimumMethod| per_method.iter().any(|(asked, _)| asked == method);
    let methods = [MinimumMethod::Akima, MinimumMethod::Surface];
    let rows = methods.into_iter().filter(|method| !asked(method)).map(|method| {
        let used = usable(&of_grids(method, grids, None), options);
        let found: Vec<Minimum> = used.into_iter().filter(|m| !m.is_best_run_instead()).collect();
        (format!("minima: {method}"), found)
    });
    rows.filter(|(_, found)| found.len() >= 2).collect()
}

/// The row with N_nv + N_v as a model's size and no law of N_v. `None` if the table has no separate N_v, or too
/// few minima under this convention.
fn size_with_vocabulary(
    method: MinimumMethod,
    grids: &[Grid],
    options: &FitOptions,
) -> Option<Sensitivity> {
    // The surface needs both parameters; the parabola is its nearest kin.
    let method = if method == MinimumMethod::Surface { MinimumMethod::Parabola } else { method };
    let grids: Vec<Grid> = grids.iter().filter_map(Grid::with_total_size).collect();
    let used = usable(&of_grids(method, &grids, None), options);
    let total = FitOptions { parameters: Parameters::Total, ..options.clone() };
    let row = through("size: N = N_nv + N_v".into(), (&used, &grids), false, &total);
    row.exponent_params.map(|_| row)
}

/// The row of the laws through some minima.
fn through(
    variant: String,
    (minima, grids): (&[Minimum], &[Grid]),
    several: bool,
    options: &FitOptions,
) -> Sensitivity {
    let set = LawSet::through(minima, grids, options);
    let laws = set.as_ref().map(|set| set.powers(several, options.parameters));
    row(variant, &laws.unwrap_or_default(), set.map(|set| set.log.slope_per_decade))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fit::fit;
    use crate::laws::fit::tests::{options, simulated};
    use crate::laws::input::IsoFlopPoint;
    use crate::laws::ranking::Score;
    use crate::laws::simulated::of_split;

    fn tested(unique_tokens: f64) -> Vec<Candidate> {
        let laws = fit(&of_split(unique_tokens, simulated().points()), &options()).unwrap();
        laws.judgement.recommended.unwrap().scores.into_iter().map(|score| score.law).collect()
    }

    #[test]
    fn a_sweep_that_repeats_its_data_is_judged_by_the_joint_law_that_knows_it() {
        let most = simulated().points().iter().map(|point| point.tokens).fold(0.0, f64::max);
        for (unique_tokens, expected) in
            [(most / 2.0, Candidate::JointRepeats), (most, Candidate::Joint)]
        {
            let tested = tested(unique_tokens);
            let joint: Vec<&Candidate> = tested.iter().filter(|law| law.is_joint()).collect();
            assert_eq!(joint, [&expected], "{tested:?}");
        }
    }

    #[test]
    fn a_doubtful_minimum_takes_no_law_out_of_the_comparison() {
        let all = simulated().points();
        let smallest = all.iter().map(|point| point.budget_flops).fold(f64::INFINITY, f64::min);
        let (optimum, _) = crate::laws::simulated::known_optimum(smallest);
        // The smallest budget's sizes all lie above its optimum.
        let is_kept = |point: &IsoFlopPoint| {
            point.budget_flops > smallest || point.params_nonvocab.ln() > optimum + 0.3
        };
        let kept: Vec<IsoFlopPoint> = all.into_iter().filter(is_kept).collect();
        let laws = fit(&kept, &options()).unwrap();
        let doubtful = laws.minima.iter().find(|m| m.budget_flops == smallest).unwrap();
        assert!(!doubtful.is_usable(), "{doubtful:?}");
        let scores = laws.judgement.recommended.unwrap().scores;
        let law = |law: Candidate| scores.iter().find(|score| score.law == law).unwrap();
        let tested =
            |score: &Score| score.misses.iter().filter(|miss| miss.minimum.is_some()).count();
        assert_eq!(tested(law(Candidate::Log)), tested(law(Candidate::Joint)));
        // The joint law is tested where the others cannot be fitted yet, too.
        assert!(law(Candidate::Joint).misses.len() > law(Candidate::Log).misses.len());
    }
}
