//! The parts of the summary that question the laws: unseen budgets, and what to run next.

use crate::laws::text::count;
use crate::laws::{Advice, AdviceKind, Laws, Validation, ValidationKind};
use crate::words::number::{known, thousandths};
use crate::words::{listed, wrap};

/// The errors on budgets that the laws had not seen; empty where there are none.
pub(super) fn unseen_budgets(laws: &Laws) -> String {
    if laws.validation.is_empty() {
        return String::new();
    }
    let head = format!(
        "\n{:<27}{:>8}{:>9}{:>9}{:>9}{:>9}{:>9}\n",
        "unseen budgets, pred./meas.",
        "n",
        "log err",
        "floor",
        laws.parameters.size(),
        "N_v",
        "D"
    );
    head + &laws.validation.iter().map(unseen).collect::<String>()
}

fn unseen(row: &Validation) -> String {
    let kind = match row.kind {
        ValidationKind::LeaveOneOut => "left out",
        ValidationKind::RollForward => "from smaller",
    };
    let ratio = |x: Option<f64>| known(x, thousandths);
    format!(
        "{kind:<16}{:>11}{:>8}{:>+9.4}{:>9}{:>9}{:>9}{:>9}\n",
        count(row.budget_flops),
        row.n_fitted,
        row.log_error,
        known(row.floor_error, |x| format!("{x:+.4}")),
        ratio(row.params_nonvocab_ratio.or(row.params_ratio)),
        ratio(row.params_vocab_ratio),
        ratio(Some(row.tokens_ratio)),
    )
}

/// What to run next, one item an advice; empty where there is none.
pub(super) fn advice(laws: &Laws) -> String {
    let advice = &laws.advice;
    if advice.is_empty() {
        return String::new();
    }
    let file = "--next FILE writes this as a sweep, with models and codebooks that can be built.";
    let file = if laws.from_sweep { wrap("  ", file) } else { String::new() };
    listed("what to run next", advice.iter().map(advised)) + &file
}

fn advised(advice: &Advice) -> String {
    let what = match advice.kind {
        AdviceKind::AddSizes => "add sizes",
        AdviceKind::AddVocabularies => "add vocabularies",
        AdviceKind::AddSeeds => "add seeds",
        AdviceKind::LargerBudget => "add this budget",
        AdviceKind::NextBudget => "the next budget, if any",
    };
    let list = |values: &[f64], number: fn(f64) -> String| {
        values.iter().map(|x| number(*x)).collect::<Vec<_>>().join(", ")
    };
    let vocabularies = match &advice.n_vocab[..] {
        [] => String::new(),
        tried => format!("; V {}", list(tried, |x| format!("{x:.0}"))),
    };
    format!(
        "{} FLOPs, {what}: {}. Sizes {}{vocabularies}: {} runs, {} FLOPs.",
        count(advice.budget_flops),
        advice.why,
        list(&advice.params_nonvocab, count),
        advice.runs,
        count(advice.flops),
    )
}
