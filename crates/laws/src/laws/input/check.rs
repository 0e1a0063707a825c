//! What a row must hold before anything is computed from it.

use super::cell::compare;
use super::error::FitError;
use super::metric::Metric;
use super::point::{IsoFlopPoint, Parameters};

/// Rejects a row whose logarithms do not exist, whose loss is no number or whose vocabulary is not
/// as `parameters` says.
pub(in crate::laws) fn point(p: &IsoFlopPoint, parameters: Parameters) -> Result<(), FitError> {
    let counts = [
        ("budget_flops", p.budget_flops),
        ("flops", p.flops),
        ("params_nonvocab", p.params_nonvocab),
        ("tokens", p.tokens),
        ("weight", p.weight),
    ];
    let vocabulary = [("params_vocab", p.params_vocab), ("n_vocab", p.n_vocab)];
    let bad = |field, value, expected| {
        Err(FitError::BadValue { run_id: p.run_id.clone(), field, value, expected })
    };
    let is_count = |(_, v): &(&str, f64)| v.is_finite() && *v > 0.0;
    if let Some((field, value)) = counts.into_iter().find(|count| !is_count(count)) {
        return bad(field, value, "finite and above 0");
    }
    let (is_known, expected): (fn(f64) -> bool, _) = match parameters {
        Parameters::Split => (|v| v.is_finite() && v > 0.0, "finite and above 0"),
        Parameters::Total => (|v| v == 0.0, "0, since N alone is given"),
    };
    if let Some((field, value)) = vocabulary.into_iter().find(|(_, v)| !is_known(*v)) {
        return bad(field, value, expected);
    }
    if p.loss.is_finite() { Ok(()) } else { Err(loss(p, "finite")) }
}

/// The loss of a row is not as `expected`.
pub(in crate::laws) fn loss(p: &IsoFlopPoint, expected: &'static str) -> FitError {
    let (run_id, metric) = (p.run_id.clone(), p.metric.clone());
    FitError::BadLoss { run_id, metric, value: p.loss, expected }
}

/// The metric that every row holds; that of no rows is the default.
///
/// # Errors
/// [`FitError::Metrics`] for rows that hold different ones.
pub(in crate::laws) fn metric(points: &[IsoFlopPoint]) -> Result<Metric, FitError> {
    let Some(first) = points.first() else { return Ok(Metric::default()) };
    match points.iter().find(|point| point.metric != first.metric) {
        None => Ok(first.metric.clone()),
        Some(other) => Err(FitError::Metrics {
            run_id: other.run_id.clone(),
            metric: other.metric.clone(),
            first: first.metric.clone(),
        }),
    }
}

/// How many cells, tokenizers and seeds more than one row holds, and the first repeat.
///
/// Repeats of one seed are averaged like seeds, which is wrong where they differ by a setting that
/// the table does not show, such as the learning rate.
pub(in crate::laws) fn repeats(points: &[IsoFlopPoint]) -> Option<(usize, &str)> {
    let mut rows: Vec<_> = points.iter().collect();
    let own = |p: &IsoFlopPoint| (p.seed, p.about.tokenizer.clone());
    rows.sort_by(|a, b| compare(&key(a), &key(b)).then_with(|| own(a).cmp(&own(b))));
    let groups = rows.chunk_by(|a, b| key(a) == key(b) && own(a) == own(b));
    let repeated: Vec<_> = groups.filter(|g| g.len() > 1).map(|g| g[1].run_id.as_str()).collect();
    Some((repeated.len(), *repeated.first()?))
}

fn key(p: &IsoFlopPoint) -> [f64; 5] {
    [p.budget_flops, p.params_nonvocab, p.params_vocab, p.n_vocab, p.share()]
}
