//! [`sliced`]: runs as laws by another count of FLOPs see them.

use super::facts::LOSS_NORMALISED;
use super::run_record::{RunRecord, of_largest_share};
use crate::laws::{FitError, IsoFlopPoint, Metric, slices};
use crate::spec::FlopsRule;

/// The runs moved to equal FLOPs by a rule, with the budgets, tokens and L_u that they have there: see
/// [`slices`]. Those that lack the count, saw a smaller share of the data than others or cannot be moved are
/// left out.
///
/// # Errors
/// A run has a value that no law can use.
pub fn sliced(records: &[RunRecord], rule: FlopsRule) -> Result<Vec<RunRecord>, FitError> {
    let point = |record| Some((record, RunRecord::point(record, rule, &Metric::default()).ok()?));
    let (records, points): (Vec<&RunRecord>, Vec<IsoFlopPoint>) =
        of_largest_share(records).filter_map(point).unzip();
    let moved = records.into_iter().zip(slices(&points)?.points);
    Ok(moved.filter_map(|(record, point)| Some(at(record, rule, &point?))).collect())
}

fn at(record: &RunRecord, rule: FlopsRule, point: &IsoFlopPoint) -> RunRecord {
    let mut moved = record.clone();
    moved.planned.budget_flops = point.budget_flops;
    moved.measured.tokens = point.tokens.round() as usize;
    *moved.measured.flops_mut(rule) = Some(point.flops);
    moved.metrics.set(LOSS_NORMALISED, point.loss);
    moved
}
