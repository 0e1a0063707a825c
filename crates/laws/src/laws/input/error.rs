//! Why a table of runs gives no laws.

use super::method::MinimumMethod;
use super::metric::Metric;
use crate::laws::words::text::count;

/// Why [`fit`](crate::laws::fit::fit()) gave no laws; every message says what is wrong, where, and the remedy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    #[error("no runs to fit: finish some runs first, or give a table that has rows")]
    NoPoints,

    #[error("{run_id}: {field} is {value}, but it must be {expected}; mend or drop that row")]
    BadValue { run_id: String, field: &'static str, value: f64, expected: &'static str },

    #[error("{run_id}: {metric} is {value}, but it must be {expected}; mend or drop that row")]
    BadLoss { run_id: String, metric: Metric, value: f64, expected: &'static str },

    #[error(
        "{run_id} holds {metric} as its loss, and the first row {first}; fit one of them at a time"
    )]
    Metrics { run_id: String, metric: Metric, first: Metric },

    #[error("fit option {option} is {value}, but it must be {expected}")]
    BadOption { option: &'static str, value: String, expected: &'static str },

    #[error("held-out budget {asked:e} has no runs; the table has these budgets: {}", listed(.budgets))]
    HoldOutAbsent { asked: f64, budgets: Vec<f64> },

    #[error("{found} budget(s) left to fit, but a law in C needs two: run more, or hold none out")]
    TooFewBudgets { found: usize },

    #[error(
        "the table declares no budgets, so there are no minima to find: name their column as \
         budget_flops in --columns (rounded, as 10^(round(10*log10(6*N*D))/10)), or fit every run at \
         once with --law approach3"
    )]
    NoBudgets,

    #[error(
        "{rows} rows have {budgets} different budgets, so hardly two share one and there are no \
         minima to find: round them, as budget_flops=10^(round(10*log10(C))/10) in --columns, or fit \
         every run at once with --law approach3"
    )]
    ScatteredBudgets { rows: usize, budgets: usize },

    #[error("not identified: {0}")]
    NotIdentified(String),

    #[error(
        "{usable} budget(s) with an unflagged {method} minimum, but a law in C needs two; \
         flagged: {flagged}; widen the grid there, or keep flagged minima"
    )]
    TooFewMinima { method: MinimumMethod, usable: usize, flagged: String },
}

impl FitError {
    /// Whether the data cannot tell the laws (exit code 3), rather than a value or option being
    /// wrong (exit code 2).
    pub fn is_unidentifiable(&self) -> bool {
        matches!(
            self,
            Self::NoPoints
                | Self::TooFewBudgets { .. }
                | Self::TooFewMinima { .. }
                | Self::NotIdentified(_)
                | Self::NoBudgets
                | Self::ScatteredBudgets { .. }
        )
    }
}

fn listed(budgets: &[f64]) -> String {
    budgets.iter().map(|budget| count(*budget)).collect::<Vec<_>>().join(", ")
}
