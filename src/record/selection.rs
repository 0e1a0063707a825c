//! Selects the runs for laws: the largest share, equal FLOPs, and the best variant of a varied key.

use std::collections::BTreeMap;

use super::facts::LOSS_NORMALISED;
use super::run_record::RunRecord;
use crate::laws::{FitError, IsoFlopPoint, Metric, slices};
use crate::spec::FlopsRule;

/// The runs that saw as much of the data as any.
pub fn of_largest_share(records: &[RunRecord]) -> impl Iterator<Item = &RunRecord> {
    let most = records.iter().map(RunRecord::share).fold(0.0, f64::max);
    records.iter().filter(move |record| record.share() == most)
}

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
    Ok(moved.filter_map(|(record, point)| Some(at_equal_flops(record, rule, &point?))).collect())
}

fn at_equal_flops(record: &RunRecord, rule: FlopsRule, point: &IsoFlopPoint) -> RunRecord {
    let mut moved = record.clone();
    moved.planned.budget_flops = point.budget_flops;
    moved.measured.tokens = point.tokens.round() as usize;
    *moved.measured.flops_mut(rule) = Some(point.flops);
    moved.metrics.set(LOSS_NORMALISED, point.loss);
    moved
}

/// The runs that represent their cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Tuned {
    /// In their order; all runs if nothing was varied.
    pub records: Vec<RunRecord>,
    /// A sentence on how often each variant was best; `None` if nothing was varied.
    pub told: Option<String>,
}

/// A cell without varied keys: generator, layers, heads, width, vocabulary, budget and share.
type Cell = (Option<String>, [Option<usize>; 3], usize, [u64; 2]);

/// Variants that a sentence names, at most.
const NAMED: usize = 4;

impl Tuned {
    /// The variant of each cell with the lowest mean L_u over seeds and tokenizers.
    pub fn of(records: &[RunRecord]) -> Self {
        if records.iter().all(|record| record.planned.varied.is_none()) {
            return Self { records: records.to_vec(), told: None };
        }
        let mut losses: BTreeMap<Cell, BTreeMap<Option<&str>, Vec<f64>>> = BTreeMap::new();
        for record in records {
            let loss = record.loss_normalised().ok().filter(|loss| loss.is_finite());
            let own =
                losses.entry(cell(record)).or_default().entry(record.planned.varied.as_deref());
            own.or_default().extend(loss);
        }
        let best: BTreeMap<Cell, Option<&str>> = losses
            .into_iter()
            .filter_map(|(cell, variants)| Some((cell, best(&variants)?)))
            .collect();
        let is_best = |record: &&RunRecord| {
            best.get(&cell(record)).is_some_and(|own| *own == record.planned.varied.as_deref())
        };
        Self {
            records: records.iter().filter(is_best).cloned().collect(),
            told: Some(sentence(&best)),
        }
    }
}

fn cell(record: &RunRecord) -> Cell {
    let planned = &record.planned;
    let shape = [planned.n_layer, planned.n_head, planned.d_model];
    let spent = [planned.budget_flops, planned.share.unwrap_or(1.0)].map(f64::to_bits);
    (planned.generator.clone(), shape, planned.n_vocab, spent)
}

fn best<'a>(variants: &BTreeMap<Option<&'a str>, Vec<f64>>) -> Option<Option<&'a str>> {
    let mean = |losses: &Vec<f64>| losses.iter().sum::<f64>() / losses.len() as f64;
    let measured = variants.iter().filter(|(_, losses)| !losses.is_empty());
    measured.min_by(|a, b| mean(a.1).total_cmp(&mean(b.1))).map(|(label, _)| *label)
}

fn sentence(best: &BTreeMap<Cell, Option<&str>>) -> String {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for label in best.values() {
        *counts.entry(label.unwrap_or("as the sweep says")).or_default() += 1;
    }
    let mut counts: Vec<(&str, usize)> = counts.into_iter().collect();
    counts.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
    let mut named: Vec<String> =
        counts.iter().take(NAMED).map(|(label, n)| format!("{label} in {n}")).collect();
    if counts.len() > NAMED {
        named.push(format!("{} others", counts.len() - NAMED));
    }
    format!(
        "each of {} cells is taken at its best variant, and the best of several runs that scatter is a little \
         too good: {}",
        best.len(),
        named.join("; ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Measured, Metrics, Planned};

    fn run(n_vocab: usize, varied: Option<&str>, loss: f64) -> RunRecord {
        let planned = Planned {
            n_vocab,
            budget_flops: 1e9,
            varied: varied.map(str::to_string),
            ..Planned::default()
        };
        let metrics: Metrics = [(LOSS_NORMALISED, loss)].into_iter().collect();
        RunRecord::new(planned, Measured::default(), metrics)
    }

    #[test]
    fn each_cell_keeps_the_seeds_of_its_best_variant() {
        let (low, high) = (Some("train.lr=0.001"), Some("train.lr=0.003"));
        let records = [
            run(64, low, -1.0),
            run(64, high, -1.3),
            run(64, low, -1.2),
            run(64, high, -1.1),
            run(256, low, -1.0),
            run(256, high, f64::NAN),
        ];
        let tuned = Tuned::of(&records);
        let kept: Vec<f64> = tuned.records.iter().map(|r| r.loss_normalised().unwrap()).collect();
        assert_eq!(kept, [-1.3, -1.1, -1.0]);
        let told = tuned.told.unwrap();
        assert_eq!(
            told,
            "each of 2 cells is taken at its best variant, and the best of several runs that scatter is a \
             little too good: train.lr=0.001 in 1; train.lr=0.003 in 1"
        );
        let plain = [run(64, None, -1.0), run(64, None, -2.0)];
        assert_eq!(Tuned::of(&plain), Tuned { records: plain.to_vec(), told: None });
    }
}
