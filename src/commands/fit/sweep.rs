//! Fits the laws of a sweep's records.

use super::args::FitArgs;
use crate::commands::predict::openai_blocks;
use crate::commands::prelude::*;
use isoflop::laws::{
    self, FitError, FitOptions, HoldOut, IsoFlopPoint, Metric, Sensitivity, of_largest_share,
    sensitivity_row, slices,
};
use isoflop::spec::flops::TRAINING_PER_FORWARD;
use isoflop::sweep::HoldOutSpec;

/// The input of a fit, besides the records.
pub struct SweepFit {
    /// The FLOP rule of the plan.
    planned: FlopsRule,
    /// The FLOP rule of the laws.
    pub rule: FlopsRule,
    pub options: FitOptions,
}

/// The settings of the sweep's file.
pub fn options(sweep: &Sweep) -> SweepFit {
    let hold_out = match sweep.fit.hold_out {
        HoldOutSpec::LargestBudget => HoldOut::LargestBudget,
        HoldOutSpec::None => HoldOut::None,
    };
    let options = FitOptions {
        name: sweep.name.clone(),
        flops_rule: sweep.flops.rule.name().to_string(),
        methods: sweep.fit.minima.clone(),
        hold_out,
        bootstrap: sweep.fit.bootstrap,
        ..FitOptions::default()
    };
    SweepFit { planned: sweep.flops.rule, rule: sweep.flops.rule, options }
}

/// The same with overrides from the command line.
pub fn overridden(fit: SweepFit, request: &FitArgs) -> SweepFit {
    let rule = request.flops.unwrap_or(fit.rule);
    let options = FitOptions { flops_rule: rule.name().to_string(), ..asked(fit.options, request) };
    SweepFit { rule, options, ..fit }
}

/// Options with overrides from the command line.
pub fn asked(options: FitOptions, request: &FitArgs) -> FitOptions {
    FitOptions {
        seed: request.seed.unwrap_or(0),
        bootstrap: request.bootstrap.unwrap_or(options.bootstrap),
        law_method: request.minima.or(options.law_method),
        hold_out: request.hold_out.unwrap_or(options.hold_out),
        huber: request.huber_mads().or(options.huber),
        keep_flagged: options.keep_flagged || request.keep_flagged,
        ..options
    }
}

/// Laws of finished runs, with rows of the sensitivity table for the other counts of FLOPs.
pub fn fit_records(records: &[RunRecord], fit: &SweepFit) -> Result<Laws, FitError> {
    let (counted, left_out) = points(records, fit.rule);
    let n_points = counted.len();
    let (points, options, told) = in_slices(counted, fit)?;
    let mut laws = fit_or_keep_flagged(&points, &options)?;
    laws.warnings.splice(0..0, left_out.into_iter().chain(told));
    let others = FlopsRule::ALL.into_iter().filter(|rule| *rule != fit.rule);
    laws.sensitivity.extend(others.filter_map(|rule| refit(records, n_points, rule, fit)));
    Ok(of_own_models(laws, records))
}

/// Points at equal FLOPs by the rule of a fit: runs of a sweep planned by another rule are moved. Also a sentence
/// about it; `None` if the sweep was planned by that rule.
fn in_slices(
    points: Vec<IsoFlopPoint>,
    fit: &SweepFit,
) -> Result<(Vec<IsoFlopPoint>, FitOptions, Option<String>), FitError> {
    let mut options = fit.options.clone();
    if fit.rule == fit.planned || points.is_empty() {
        return Ok((points, options, None));
    }
    let all = points.len();
    let points = of_largest_share(&points);
    let smaller = match all - points.len() {
        0 => String::new(),
        n => format!(" {n} runs of smaller shares of the data are left out."),
    };
    let slices = slices(&points)?;
    if let HoldOut::Budget(asked) = options.hold_out {
        options.hold_out = HoldOut::Budget(slices.level_of(asked).unwrap_or(asked));
    }
    let moved: Vec<IsoFlopPoint> = slices.points.into_iter().flatten().collect();
    let left_out = match points.len() - moved.len() {
        0 => String::new(),
        n => format!(" {n} of {} do not reach so far and are left out.", points.len()),
    };
    let told = format!(
        "The budgets were spent by the rule {}: each run is moved along its cell to equal FLOPs by {}.\
         {left_out}{smaller}",
        fit.planned.name(),
        fit.rule.name(),
    );
    Ok((moved, options, Some(told)))
}

/// Marks laws as those of this project's own models.
pub fn of_own_models(mut laws: Laws, records: &[RunRecord]) -> Laws {
    laws.from_sweep = true;
    laws.n_ctx = records.iter().filter_map(|record| record.planned.n_ctx).max();
    laws.head_share = head_share(records);
    // The user's own codes have no tokenizer.
    let is_own = |record: &RunRecord| record.planned.tokenizer_id.as_deref() == Some("none");
    laws.own_vocabularies = records.iter().all(is_own);
    laws.answered()
}

/// A small grid may have too few unflagged minima; then flagged ones are used, each named in the laws' warnings.
fn fit_or_keep_flagged(points: &[IsoFlopPoint], options: &FitOptions) -> Result<Laws, FitError> {
    match laws::fit(points, options) {
        Err(FitError::TooFewMinima { .. }) if !options.keep_flagged => {
            laws::fit(points, &FitOptions { keep_flagged: true, ..options.clone() })
        }
        other => other,
    }
}

/// The laws under another count of FLOPs; `None` unless exactly `n_points` runs have it.
fn refit(
    records: &[RunRecord],
    n_points: usize,
    rule: FlopsRule,
    fit: &SweepFit,
) -> Option<Sensitivity> {
    let options = FitOptions {
        flops_rule: rule.name().to_string(),
        bootstrap: 0,
        recommend: false,
        ..fit.options.clone()
    };
    let (points, _) = points(records, rule);
    // Laws of different runs would differ for another reason than the rule.
    let fit = SweepFit { planned: fit.planned, rule, options };
    let (points, options, _) =
        (points.len() == n_points).then(|| in_slices(points, &fit).ok())??;
    let laws = fit_or_keep_flagged(&points, &options).ok()?;
    Some(sensitivity_row(&format!("flops: {}", rule.name()), &laws))
}

/// The fraction of the vocabulary that a code is chosen among; `None` if it is all of it, or unknown.
fn head_share(records: &[RunRecord]) -> Option<f64> {
    // FLOPs per token outside the blocks by the OpenAI rule, as a fraction of a head over all codes.
    let share_of = |RunRecord { planned, measured, .. }: &RunRecord| {
        let (layers, width) = (planned.n_layer?, planned.d_model?);
        let tokens = TRAINING_PER_FORWARD * measured.tokens as f64;
        let head = measured.flops_openai? / tokens - openai_blocks(layers, width, planned.n_ctx?);
        Some(head / (2 * planned.n_vocab * width) as f64)
    };
    records.iter().find_map(share_of).filter(|share| *share < 0.999)
}

/// The runs as points of the laws, and a sentence on runs whose records are incomplete.
pub fn points(records: &[RunRecord], rule: FlopsRule) -> (Vec<IsoFlopPoint>, Option<String>) {
    let metric = Metric::default();
    let (mut points, mut lacking) = (Vec::with_capacity(records.len()), Vec::new());
    for record in records {
        match record.point(rule, &metric) {
            Ok(point) => points.push(point),
            Err(error) => lacking.push(format!("run {}: {error}", record.planned.run_id)),
        }
    }
    let left_out = lacking.first().map(|first| {
        format!("{} of {} runs are left out; the first is {first}.", lacking.len(), records.len())
    });
    (points, left_out)
}
