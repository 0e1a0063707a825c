//! What is said before and after a round.

use isoflop::plan::Plan;
use isoflop::record::{RunRecord, flops_per_second};

use super::history::{AfterRound, History};
use crate::commands::plan_text::time;

/// What a round is about to cost.
pub fn price(plan: &Plan, history: &History, records: Vec<RunRecord>) -> String {
    let (number, total) = (history.rounds.len(), plan.total_flops());
    let Some(round) = history.rounds.last() else { return String::new() };
    let rate = flops_per_second(records);
    let hours = rate.map_or_else(String::new, |rate| {
        format!(", {} of a core", time(round.flops / rate / 3600.0))
    });
    format!(
        "round {number}: {} runs, {:.2e} FLOPs{hours}; {:.0} % of the grid so far",
        round.runs.len(),
        round.flops,
        100.0 * history.flops() / total
    )
}

/// What is known after a round.
pub fn said(number: usize, known: &AfterRound) -> String {
    let (Some(loss), Some([low, high])) = (known.loss_normalised, known.loss_ci95) else {
        return format!("round {number}: no prediction yet");
    };
    let budget = known.budget_flops;
    let width = known.half_width().map(|width| format!("±{:.1} %", 100.0 * width));
    let width = width.unwrap_or_else(|| "no forecast tested yet".to_string());
    format!("round {number}: L_u at {budget:e} is {loss:.3} ({low:.3} to {high:.3}), {width}")
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
