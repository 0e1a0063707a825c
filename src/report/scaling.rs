//! What a study spans, and how its budgets are told apart.

use std::collections::BTreeMap;

use super::words::Words;
use crate::laws::text::count;
use crate::record::{RunRecord, of_largest_share};

/// The runs of a study in a sentence.
pub fn extent(records: &[&RunRecord]) -> String {
    let budgets = budgets(records.iter().copied());
    let span = match (budgets.first(), budgets.last()) {
        (Some(first), Some(last)) => format!(" at {} to {} FLOPs", count(*first), count(*last)),
        _ => String::new(),
    };
    let seconds: f64 = records.iter().filter_map(|record| record.measured.wall_s).sum();
    // A table made elsewhere knows no times.
    let hours =
        if seconds > 0.0 { format!(", {:.1} core-hours", seconds / 3600.0) } else { String::new() };
    format!("{} runs{span}{hours}", records.len())
}

/// The budgets of runs, ascending.
pub fn budgets<'a>(records: impl IntoIterator<Item = &'a RunRecord>) -> Vec<f64> {
    let records = records.into_iter();
    let mut budgets: Vec<f64> = records.map(|record| record.planned.budget_flops).collect();
    budgets.sort_by(f64::total_cmp);
    budgets.dedup();
    budgets
}

/// The runs of a budget on the largest share of the data.
pub fn of_budget(records: &[RunRecord], budget: f64) -> impl Iterator<Item = &RunRecord> {
    of_largest_share(records).filter(move |record| record.planned.budget_flops == budget)
}

/// N_nv and L_u of a run, if it has a loss.
pub fn point(record: &RunRecord) -> Option<(f64, f64)> {
    Some((record.planned.params_nonvocab as f64, record.loss_normalised().ok()?))
}

/// The lowest L_u of each N_nv at a budget, with its run.
pub fn best_of_sizes(records: &[RunRecord], budget: f64) -> Vec<&RunRecord> {
    let mut best: BTreeMap<usize, (&RunRecord, f64)> = BTreeMap::new();
    for record in of_budget(records, budget) {
        let Ok(loss) = record.loss_normalised() else { continue };
        let kept = best.entry(record.planned.params_nonvocab).or_insert((record, loss));
        if loss < kept.1 {
            *kept = (record, loss);
        }
    }
    best.into_values().map(|(record, _)| record).collect()
}

/// A run in a line.
pub fn label(record: &RunRecord, words: &Words) -> String {
    let planned = &record.planned;
    let loss = record
        .loss_normalised()
        .map_or("no loss".to_string(), |loss| format!("{} {loss:.4}", words.loss));
    let vocab = if words.has_vocab { format!(", V {}", planned.n_vocab) } else { String::new() };
    let generator = planned.generator.as_deref().unwrap_or("run");
    let seed = planned.seed.map_or_else(String::new, |seed| format!(", seed {seed}"));
    format!(
        "{generator}, {} {}{vocab}, C {}, D {}{seed}: {loss}",
        words.size,
        count(planned.params_nonvocab as f64),
        count(planned.budget_flops),
        count(record.measured.tokens as f64),
    )
}
