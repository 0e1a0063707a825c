//! What is said before and after a round.

use isoflop::plan::Plan;
use isoflop::record::{RunRecord, flops_per_second};

use super::history::{History, Known};
use crate::commands::plan_text::time;

/// What a round is about to cost.
pub fn price(plan: &Plan, history: &History, records: &[RunRecord]) -> String {
    let (number, total) = (history.rounds.len(), plan.total_flops());
    let Some(round) = history.rounds.last() else { return String::new() };
    let rate = flops_per_second(records.iter().cloned());
    let hours = rate.map_or_else(String::new, |rate| {
        format!(", {} of one core", time(round.flops / rate / 3600.0))
    });
    format!(
        "round {number}: {} runs, {:.2e} FLOPs{hours}; {:.0} % of the grid's FLOPs with those before",
        round.runs.len(),
        round.flops,
        100.0 * history.flops() / total
    )
}

/// What is known after a round.
pub fn said(number: usize, known: &Known) -> String {
    let Known { budget_flops, loss_normalised, loss_ci95, is_tested } = known;
    let (Some(loss), Some([low, high])) = (loss_normalised, loss_ci95) else {
        return format!("round {number}: no prediction yet");
    };
    let width = match known.half_width() {
        Some(width) => format!("±{:.1} %", 100.0 * width),
        None if *is_tested => "of no width".to_string(),
        None => "which no larger budget has tested yet".to_string(),
    };
    format!(
        "round {number}: L_u at {budget_flops:.0e} FLOPs is {loss:.3} (95 %: {low:.3} to {high:.3}), {width}"
    )
}

/// How much of the grid the rounds took.
pub fn taken(plan: &Plan, history: &History) -> String {
    format!(
        "{} rounds took {} of {} runs and {:.0} % of the grid's FLOPs",
        history.rounds.len(),
        history.runs().count(),
        plan.runs.len(),
        100.0 * history.flops() / plan.total_flops()
    )
}
