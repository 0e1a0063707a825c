//! The parts of the summary that question the laws: unseen budgets, and what to run next.

use crate::laws::Laws;
use crate::laws::text::count;
use crate::laws::{Advice, AdviceKind};
use crate::laws::{Validation, ValidationKind};
use crate::words::wrap;

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
    let ratio = |x: Option<f64>| x.map_or_else(|| "-".into(), |x| format!("{x:.3}"));
    format!(
        "{kind:<16}{:>11}{:>8}{:>+9.4}{:>9}{:>9}{:>9}{:>9}\n",
        count(row.budget_flops),
        row.n_fitted,
        row.log_error,
        row.floor_error.map_or_else(|| "-".into(), |x| format!("{x:+.4}")),
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
    let line = |advice: &Advice| wrap("  - ", &advised(advice));
    let file = match laws.from_sweep {
        true => wrap(
            "  ",
            "--next FILE writes this as a sweep, with models and codebooks that can be built.",
        ),
        false => String::new(),
    };
    "\nwhat to run next\n".to_string() + &advice.iter().map(line).collect::<String>() + &file
}

fn advised(advice: &Advice) -> String {
    let what = match advice.kind {
        AdviceKind::AddSizes => "add sizes",
        AdviceKind::AddVocabularies => "add vocabularies",
        AdviceKind::AddSeeds => "add seeds",
        AdviceKind::LargerBudget => "add this budget",
        AdviceKind::NextBudget => "the next budget, if any",
    };
    let list = |values: &[f64]| values.iter().map(|x| count(*x)).collect::<Vec<_>>().join(", ");
    let whole =
        |values: &[f64]| values.iter().map(|x| format!("{x:.0}")).collect::<Vec<_>>().join(", ");
    let vocabularies = match &advice.n_vocab[..] {
        [] => String::new(),
        tried => format!("; V {}", whole(tried)),
    };
    format!(
        "{} FLOPs, {what}: {}. Sizes {}{vocabularies}: {} runs, {} FLOPs.",
        count(advice.budget_flops),
        advice.why,
        list(&advice.params_nonvocab),
        advice.runs,
        count(advice.flops),
    )
}
