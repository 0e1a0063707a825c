//! What a fit says of itself: how its runs scatter, what its curves miss, which law to believe.

use crate::laws::file::judgement::{IntervalPart, Judgement, Tried};
use crate::laws::file::laws::Laws;
use crate::laws::input::cell::Cell;
use crate::laws::input::method::MinimumMethod;
use crate::laws::input::options::FitOptions;
use crate::laws::joint::bootstrap::replicates;
use crate::laws::joint::fit::fit_joint;
use crate::laws::joint::law::JointLaw;
use crate::laws::joint::weighed::repeat;
use crate::laws::lines::bootstrap::{Bootstrap, Sources};
use crate::laws::lines::sample::LawSample;
use crate::laws::maths::stats::{extent, interval95};
use crate::laws::minima::grid::Grid;
use crate::laws::minima::lack_of_fit;
use crate::laws::minima::run_noise::RunNoise;
use crate::laws::minima::types::Minimum;
use crate::laws::noise::Scatter;
use crate::laws::ranking::forecast_error::ForecastError;
use crate::laws::ranking::recommended::{Candidate, Recommended};
use crate::laws::ranking::{Rows, shares};
use crate::laws::say::reasons::why_recommended;
use crate::laws::say::warnings::of_spend;

/// Replicates of the joint law at most: each is a fit of its own.
const JOINT_REPLICATES: usize = 200;
/// Replicates by which a part of an interval is told.
const PART_REPLICATES: usize = 100;

/// Which law to believe, and how far.
pub(super) fn judge(
    laws: &Laws,
    grids: &[Grid],
    per_method: &[(MinimumMethod, Vec<Minimum>)],
    interval_parts: Vec<IntervalPart>,
    scatter: Scatter,
    options: &FitOptions,
) -> Judgement {
    let methods = per_method.iter().map(|(method, _)| *method);
    let misfit = |method| lack_of_fit(method, grids, scatter.noise?);
    let own = Judgement {
        lack_of_fit: methods.filter_map(misfit).collect(),
        tokenizer_noise: scatter.tokenizers.cloned(),
        test_noise: scatter.test.cloned(),
        interval_parts,
        tried: Some(tried(grids)),
        rows: unequal_spend(grids).into_iter().collect(),
        ..Judgement::default()
    };
    if !options.recommend {
        return own;
    }
    let minima: Vec<Minimum> = laws.own_minima().cloned().collect();
    let shares = shares(grids, (laws.minima_method, &minima), scatter.noise, options);
    let rows = Rows { grids, shares, noise: scatter.noise, options };
    let joint = fit_joint(grids, scatter.noise, repeat(grids));
    let recommended = rank(&rows, laws, joint.as_ref());
    let misses = recommended.scores.first().map_or(&[][..], |best| &best.misses);
    Judgement {
        forecast_error: Some(ForecastError::of(misses)),
        joint: joint.map(|law| with_replicates(law, grids, scatter, options)),
        recommended: Some(recommended),
        ..own
    }
}

/// [`LackOfFit::variance_ratio`](crate::laws::minima::types::LackOfFit::variance_ratio) of the laws' method; 1 where no
/// curve leaves residuals.
pub(super) fn misfit(method: MinimumMethod, grids: &[Grid], noise: RunNoise) -> f64 {
    lack_of_fit(method, grids, noise).map_or(1.0, |lack| lack.variance_ratio())
}

/// The curves whose minima may all be used where those of the laws' method are; that method alone
/// where it is the best run.
pub(super) fn admissible(
    per_method: &[(MinimumMethod, Vec<Minimum>)],
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

/// The recommendation over all budgets, measured minima beside each grid. Where none could be tested it is
/// the smooth loss through all cells, which forecast best on other tables (`docs/which-law.md`), else the
/// law with a floor, else the log law.
fn rank(rows: &Rows, laws: &Laws, joint: Option<&JointLaw>) -> Recommended {
    let untested = match (joint, &laws.loss.floor) {
        (Some(joint), _) => joint.candidate(),
        (None, Some(_)) => Candidate::Floor,
        (None, None) => Candidate::Log,
    };
    let mut scores = rows.scores();
    // A law of minima that all budgets together do not tell predicts nothing.
    scores.retain(|score| score.law.is_joint() || laws.power_laws.tokens.is_some());
    let law = scores.first().map_or(untested, |best| best.law);
    let why = why_recommended(&scores, rows.grids.len());
    Recommended { law, minima_method: laws.minima_method, why, scores }
}

/// The joint law of some budgets with its replicates: it is asked of models that are not optimal and of repeated
/// data also where another law is recommended.
fn with_replicates(
    mut joint: JointLaw,
    grids: &[Grid],
    scatter: Scatter,
    options: &FitOptions,
) -> JointLaw {
    let count = options.bootstrap.min(JOINT_REPLICATES);
    joint.bootstrap = replicates(&joint, grids, (scatter, options.seed), count);
    joint
}

/// What the intervals of the exponents would be for each reason alone.
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
