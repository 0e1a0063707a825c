//! Warnings of a fit: data left out, and weak assumptions.

use super::{flagged, flags_text};
use crate::laws::input::{Cell, FitOptions, Metric, MinimumMethod, Parameters};
use crate::laws::lines::{EXPONENT_RANGE, FloorLaw};
use crate::laws::maths::stats::MIN_REPLICATES;
use crate::laws::minima::{Grid, Minimum, PREFERRED, RunNoise, has_residuals, n_vocabularies};
use crate::laws::parametric::{Finding, Influence, LEAST_ROWS};
use crate::laws::text::{count, short, times};

/// Largest deviation from the declared budget, as a fraction, without a warning.
const ACHIEVED_TOLERANCE: f64 = 0.05;

/// Cells that a sentence names, at most.
const NAMED: usize = 3;

pub(in crate::laws) const NOTHING_HELD_OUT: &str = "Only two budgets were run, so none is held out: the laws' \
     error beyond them is not known, and a line fits any two points.";
pub(in crate::laws) const ONE_VOCABULARY: &str = "The exponent of N_v is not identified: one vocabulary \
     only. Its law and the law of N_v in N_nv are left out.";

/// Warnings about the minima that the laws are fitted to.
pub(in crate::laws) fn of_minima(
    all: &[Minimum],
    used: &[Minimum],
    grids: &[Grid],
    method: MinimumMethod,
    options: &FitOptions,
) -> Vec<String> {
    let (kept, out): (Vec<Minimum>, Vec<Minimum>) =
        all.iter().filter(|m| !m.trusted).cloned().partition(|m| used.contains(m));
    let told = |minima: &[Minimum], how: &str| {
        let flagged = flagged(minima);
        (!minima.is_empty()).then(|| format!("Flagged minima {how} the laws of minima: {flagged}."))
    };
    let sentences = [
        told(&out, "left out of"),
        told(&kept, "used in"),
        (!has_residuals(method, grids)).then(|| NO_RESIDUALS.to_string()),
        (options.parameters == Parameters::Split && n_vocabularies(grids) == 1)
            .then(|| ONE_VOCABULARY.to_string()),
        achieved(used, options),
    ];
    sentences.into_iter().flatten().collect()
}

const NO_RESIDUALS: &str = "No budget has more model sizes than its curve has coefficients, so \
     whether a curvature is weak is not known.";

/// A warning if the worst minimum spends much more or less than its declared budget.
fn achieved(used: &[Minimum], options: &FitOptions) -> Option<String> {
    let miss = |m: &&Minimum| (m.flops / m.budget_flops).ln().abs();
    let worst = used.iter().max_by(|a, b| miss(a).total_cmp(&miss(b)))?;
    if miss(&worst) <= ACHIEVED_TOLERANCE {
        return None;
    }
    Some(format!(
        "At budget {} the optimum spends {:.3} of it under the rule {}; the laws are written in \
         declared budgets.",
        count(worst.budget_flops),
        worst.flops / worst.budget_flops,
        options.flops_rule
    ))
}

/// Where a frontier goes over so few budgets that nearly all of it is interpolated.
pub(in crate::laws) fn of_two_budgets(budgets: &[f64]) -> Option<String> {
    let [low, high] = budgets else { return None };
    Some(format!(
        "All runs spend {} or {} FLOPs: between them the frontier is interpolated, and two budgets fit any power law.",
        count(*low),
        count(*high)
    ))
}

/// Where losses differ by hardly more than runs scatter; both as standard deviations.
pub(in crate::laws) fn of_flat(losses: f64, noise: f64) -> String {
    format!(
        "The losses of all runs differ by hardly more than one run scatters ({} against {}, standard deviations): \
         they tell no optimum.",
        short(losses, 2),
        short(noise, 2)
    )
}

/// The warning if the loss rises with the budget.
pub(in crate::laws) fn of_rise(correlation: f64, metric: &Metric) -> String {
    let remedy = match metric.unit() {
        Some(_) => "lower the learning rate, or train on more data",
        None => "if higher is better, fit loss=1-score",
    };
    format!(
        "The loss rises with the budget (rank correlation {correlation:.2}), so these runs tell no optimum: {remedy}."
    )
}

/// Where the held-out minimum is itself doubtful.
pub(in crate::laws) fn of_held_out(minimum: &Minimum) -> Option<String> {
    (!minimum.flags.is_empty()).then(|| {
        format!(
            "The held-out minimum is flagged too, so the laws' error there is unreliable: {} ({}).",
            count(minimum.budget_flops),
            flags_text(&minimum.flags)
        )
    })
}

/// Why there is no floor law, or why its exponent lies at a bound.
pub(in crate::laws) fn of_floor(floor: Option<&FloorLaw>, budgets: usize) -> Option<String> {
    match floor {
        None if budgets < 3 => {
            Some(format!("The floor law has three coefficients, but {budgets} budgets are fitted."))
        }
        None => Some("The loss does not fall with C, so there is no floor law.".into()),
        Some(law) if law.exponent == EXPONENT_RANGE[0] => Some(
            "The losses show no bend against log C, so the floor law's exponent runs into its \
             lower bound and its floor means nothing."
                .into(),
        ),
        Some(law) if law.is_at_bound() => Some(
            "The loss reaches its floor at once, so the floor law's exponent runs into its upper \
             bound."
                .into(),
        ),
        Some(_) => None,
    }
}

const NO_NOISE: &str = "There are no intervals: the noise of single runs needs two degrees of freedom. \
Run every cell with a second seed, or add sizes.";
const NO_SCATTER: &str = "There are no intervals: the runs differ by no more than rounding, so intervals \
would have no width. Check that seeds differ.";

/// Replicates that failed, and intervals that are left out because replicates are too few.
pub(in crate::laws) fn of_bootstrap(
    noise: Option<RunNoise>,
    grids: &[Grid],
    succeeded: usize,
    options: &FitOptions,
) -> Vec<String> {
    let asked = options.bootstrap;
    let noiseless = match noise {
        None => Some(NO_NOISE),
        Some(noise) => noise.is_rounding(grids).then_some(NO_SCATTER),
    };
    if let Some(sentence) = noiseless {
        return if asked > 0 { vec![sentence.into()] } else { Vec::new() };
    }
    let failed = asked - succeeded;
    let few = succeeded < MIN_REPLICATES;
    let sentence = match (asked, failed) {
        (0, _) => None,
        (_, 0) if few => {
            Some(format!("{asked} bootstrap replicates are too few for intervals; ask for 1000."))
        }
        (_, 0) => None,
        _ if few => Some(format!(
            "{failed} of {asked} bootstrap replicates gave no laws of minima, so these have no intervals."
        )),
        _ => Some(format!("{failed} of {asked} bootstrap replicates gave no laws.")),
    };
    sentence.into_iter().collect()
}

/// Rows that repeat a cell and seed, the first of them by name.
pub(in crate::laws) fn of_repeats((cells, first): (usize, &str)) -> String {
    format!(
        "{cells} cell(s) have several runs of one seed, and their mean is taken; the first repeat is \
         run {first}. Keep one row for each cell and seed if they differ in a setting."
    )
}

/// Budgets without a run on the largest share of the data.
pub(in crate::laws) fn of_lost_shares(budgets: &[f64]) -> Option<String> {
    let named: Vec<String> = budgets.iter().map(|budget| count(*budget)).collect();
    (!budgets.is_empty()).then(|| {
        format!(
            "Runs at {} FLOPs used only smaller shares of the data and are left out: train them on \
            the largest share too.",
            named.join(", ")
        )
    })
}

/// Cells that have fewer runs than others, with their budgets.
pub(in crate::laws) fn of_lost_runs(lost: &[(f64, &Cell)]) -> Option<String> {
    let named = lost.iter().take(NAMED).map(|(budget, cell)| {
        let v = cell.n_vocab;
        let vocab = if v > 0.0 { format!(", V = {v}") } else { String::new() };
        format!("{} FLOPs, N = {}{vocab}", count(*budget), count(cell.params_nonvocab))
    });
    let named = named.collect::<Vec<_>>().join("; ");
    let more = match lost.len().saturating_sub(NAMED) {
        0 => String::new(),
        n => format!("; {n} more"),
    };
    (!lost.is_empty()).then(|| {
        format!(
            "{} cell(s), each the best of its size, have fewer runs than the others of their \
            budget ({named}{more}). If the missing runs diverged, the mean is biased low: \
            lower the rate, or train those cells again with other seeds.",
            lost.len()
        )
    })
}

/// A warning if the laws go through another kind of minimum than the default.
pub(in crate::laws) fn of_method(
    method: MinimumMethod,
    per_method: &[(MinimumMethod, Vec<Minimum>)],
    options: &FitOptions,
) -> Option<String> {
    let budgets = per_method.first().map_or(0, |(_, minima)| minima.len());
    let parabolas = per_method.iter().filter(|(method, _)| *method == PREFERRED[0]);
    let unflagged = parabolas.flat_map(|(_, minima)| minima).filter(|m| m.trusted).count();
    (options.law_method.is_none() && method != PREFERRED[0]).then(|| {
        format!(
            "Only {unflagged} of {budgets} budgets have an unflagged parabola, so the laws of minima use \
            the kind `{method}`."
        )
    })
}

/// A warning for runs of one budget that spend unequal shares of it: the least and the most at the worst budget.
pub(in crate::laws) fn of_spend([least, most]: [f64; 2], budget: f64) -> String {
    format!(
        "Runs of the budget {} spend {least:.2} to {most:.2} of it, so its minimum compares unequal FLOPs: name what \
         they spent as flops, or group them by it",
        count(budget)
    )
}

/// A warning if a large table gets fewer replicates than were asked for.
pub(in crate::laws) fn of_cost(cells: usize, made: usize, asked: usize) -> Option<String> {
    (made < asked).then(|| {
        format!(
            "The table has {cells} cells, so {made} bootstrap replicates are made instead of {asked}."
        )
    })
}

/// Replicates of a parametric loss that have no optimum.
pub(in crate::laws) fn of_lost_optima(lost: usize, all: usize) -> Option<String> {
    (lost > 0).then(|| {
        format!(
            "{lost} of {all} bootstrap replicates have no optimum because a term vanished: the \
            intervals use the rest."
        )
    })
}

/// The bias that the intervals of approach 1 do not cover.
pub(in crate::laws) fn of_frontier(lowest: usize, runs: usize) -> String {
    format!(
        "Approach 1 uses the {lowest} lowest of {runs} runs, and the lowest of noisy runs are lucky ones. \
        Its intervals resample training curves and do not cover this bias."
    )
}

// Doubts about a parametric fit.

impl Finding {
    pub fn sentence(&self) -> String {
        match self {
            Self::TermAbsent(quantity) => format!(
                "The term of {quantity} is not identified: the best fit does without it, so its \
                 exponent means nothing."
            ),
            Self::AtBound(quantity, bound) => format!(
                "The exponent of {quantity} is not identified: it stops at its bound {bound}."
            ),
            Self::NoFloor => "The floor E is not identified: the best fit has none.".into(),
            Self::FewStarts(reached, all) => format!(
                "Only {reached} of {all} starts reach the best optimum found: there may be a better one."
            ),
            Self::Unfinished(missing, all) => {
                format!("{missing} of {all} bootstrap replicates did not converge.")
            }
            Self::TooFewRows(rows, coefficients) => format!(
                "{rows} rows are fewer than {LEAST_ROWS} times the {coefficients} coefficients: the law \
                 follows single rows, and its intervals are too narrow. Add runs."
            ),
            Self::FewRows(rows, coefficients) => format!(
                "{rows} rows are few for {coefficients} coefficients: resampling so few makes \
                intervals too narrow."
            ),
        }
    }
}

impl Influence {
    /// The rows that move the optimal `size` most, and by how much.
    pub(in crate::laws) fn sentence(&self, size: &str) -> String {
        let Self { budget_flops, rows, params, params_without } = self;
        let factor = (params / params_without).max(params_without / params);
        format!(
            "{} row(s) move the optimal {size} at {} FLOPs by a factor {}: without {} it is {}, with \
             them {}. Check them, or leave them out by --where or --drop-highest.",
            rows.len(),
            count(*budget_flops),
            times(factor),
            rows.join(", "),
            count(*params_without),
            count(*params)
        )
    }
}
