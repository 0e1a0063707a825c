//! The laws of a sweep's own records.

use isoflop::laws::{
    self, ComputeAxis, FitError, FitOptions, HoldOut, IsoFlopPoint, Laws, Sensitivity,
    sensitivity_row,
};
use isoflop::record::RunRecord;
use isoflop::spec::FlopsRule;
use isoflop::sweep::{HoldOutSpec, Sweep};

use super::request::Request;

/// What a fit needs beside the records.
pub struct SweepFit {
    pub rule: FlopsRule,
    pub options: FitOptions,
}

/// What the sweep's file asks for.
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
    SweepFit { rule: sweep.flops.rule, options }
}

/// The same with what the command line asks for instead.
pub fn overridden(mut fit: SweepFit, request: &Request) -> SweepFit {
    let options = &mut fit.options;
    options.seed = request.seed;
    options.bootstrap = request.bootstrap.unwrap_or(options.bootstrap);
    options.law_method = request.minima.or(options.law_method);
    options.hold_out = request.hold_out.unwrap_or(options.hold_out);
    options.huber = request.huber_mads.or(options.huber);
    options.keep_flagged |= request.keep_flagged;
    if let Some(rule) = request.rule {
        let own = fit.rule == rule;
        options.compute = if own { ComputeAxis::Declared } else { ComputeAxis::Achieved };
        options.flops_rule = rule.name().to_string();
        fit.rule = rule;
    }
    fit
}

/// Laws of finished runs, with rows of the sensitivity table for the other counts of FLOPs.
pub fn fit_records(records: &[RunRecord], fit: &SweepFit) -> Result<Laws, FitError> {
    let mut laws = fit_or_keep_flagged(&points(records, fit.rule), &fit.options)?;
    laws.from_sweep = true;
    laws.n_ctx = records.iter().map(|record| record.n_ctx).max();
    let others = [FlopsRule::OpenAi, FlopsRule::SixNd, FlopsRule::Exact];
    let others = others.into_iter().filter(|rule| *rule != fit.rule);
    laws.sensitivity.extend(others.filter_map(|rule| refit(records, rule, &fit.options)));
    Ok(laws)
}

/// A small grid may have too few minima that are beyond doubt; then the doubtful ones are used, each
/// named in the laws' warnings.
fn fit_or_keep_flagged(points: &[IsoFlopPoint], options: &FitOptions) -> Result<Laws, FitError> {
    match laws::fit(points, options) {
        Err(FitError::TooFewMinima { .. }) if !options.keep_flagged => {
            laws::fit(points, &FitOptions { keep_flagged: true, ..options.clone() })
        }
        other => other,
    }
}

fn refit(records: &[RunRecord], rule: FlopsRule, options: &FitOptions) -> Option<Sensitivity> {
    let options = FitOptions {
        flops_rule: rule.name().to_string(),
        bootstrap: 0,
        compute: ComputeAxis::Achieved,
        ..options.clone()
    };
    let laws = fit_or_keep_flagged(&points(records, rule), &options).ok()?;
    Some(sensitivity_row(&format!("flops: {}", rule.name()), &laws))
}

pub fn points(records: &[RunRecord], rule: FlopsRule) -> Vec<IsoFlopPoint> {
    records.iter().map(|record| record.point(rule)).collect()
}
