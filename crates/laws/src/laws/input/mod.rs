//! The input of a fit: runs, options, and runs grouped by budget and cell.

pub(super) mod budget;
mod point;

pub(super) use budget::{
    Cell, Size, best_index, cells, compare, group_checked, is_same_budget, lost_shares, repeats,
    sizes,
};
pub use budget::{group_budgets, of_largest_share};
pub use point::{IsoFlopPoint, LOSS_NORMALISED, Metric, Parameters, PerQuantity, RunFacts};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt;

use crate::laws::text::count;

/// How the minimum of one budget was found.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    Serialize,
    Deserialize,
    JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum MinimumMethod {
    /// The best run (ScaMo).
    #[default]
    Argmin,
    /// A quadratic in ln N_nv through the best run of each size (Hoffmann et al. 2022, approach 2).
    Parabola,
    /// A cubic in ln N_nv, the parabola's check.
    Cubic,
    /// Akima's local spline in ln N_nv, which no far-off size can bend.
    Akima,
    /// A joint quadratic in (ln N_nv, ln N_v).
    Surface,
}

impl fmt::Display for MinimumMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// The budget left out of the fit, to measure the laws' error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum HoldOut {
    /// The largest; none, with a warning, if that would leave fewer than two.
    #[default]
    LargestBudget,
    None,
    /// This declared budget, in FLOPs.
    Budget(f64),
}

/// The weight of each budget in the power laws.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Weights {
    #[default]
    Equal,
    /// By its number of runs.
    Runs,
}

/// The options of [`fit`](crate::laws::fit::fit()).
#[derive(Clone, Debug, PartialEq)]
pub struct FitOptions {
    /// Name of the sweep.
    pub name: String,
    /// The rule that [`IsoFlopPoint::flops`](IsoFlopPoint::flops) was counted by.
    pub flops_rule: String,
    /// Whether the points have separate N_nv and N_v.
    pub parameters: Parameters,
    /// The kinds of minimum to report and to compare.
    pub methods: Vec<MinimumMethod>,
    /// The kind the laws are fitted to. By default the parabola, where at least three budgets (or
    /// every fitted budget, if there are only two) have an unflagged one; else the argmin, with a
    /// warning.
    pub law_method: Option<MinimumMethod>,
    pub hold_out: HoldOut,
    /// Bootstrap replicates; 0 for none.
    pub bootstrap: usize,
    /// Seed of the bootstrap.
    pub seed: u64,
    /// Fit flagged minima too.
    pub keep_flagged: bool,
    pub weights: Weights,
    /// Huber's δ in units of the residuals' MAD (scaled to σ) for the power laws; least squares
    /// where absent.
    pub huber: Option<f64>,
    /// Derive the law of D from the other two so that the laws spend C to first order around C0,
    /// instead of fitting it.
    pub spend_budget: bool,
    /// Rank the laws by their forecasts, and refit them to all budgets if one is held out.
    pub recommend: bool,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            name: "sweep".into(),
            flops_rule: "openai".into(),
            parameters: Parameters::default(),
            methods: vec![MinimumMethod::Argmin, MinimumMethod::Parabola, MinimumMethod::Cubic],
            law_method: None,
            hold_out: HoldOut::default(),
            bootstrap: 1000,
            seed: 0,
            keep_flagged: false,
            weights: Weights::default(),
            huber: None,
            spend_budget: false,
            recommend: true,
        }
    }
}

impl FitOptions {
    /// Rejects a δ that is not a positive number, and a surface over a vocabulary that is not known.
    pub(in crate::laws) fn check(&self) -> Result<(), FitError> {
        let total = self.parameters == Parameters::Total;
        if total && self.law_method == Some(MinimumMethod::Surface) {
            return Err(FitError::BadOption {
                option: "law_method",
                value: MinimumMethod::Surface.to_string(),
                expected: "another kind, since the table has one number of parameters and the \
                           surface needs N_nv and N_v",
            });
        }
        match self.huber {
            Some(delta) if !(delta.is_finite() && delta > 0.0) => Err(FitError::BadOption {
                option: "huber",
                value: delta.to_string(),
                expected: "a finite number above 0",
            }),
            _ => Ok(()),
        }
    }
}

// Why a table of runs gives no laws.

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
    /// Whether the data cannot determine the laws (exit code 3); else a value or option is wrong (exit code 2).
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

    /// The loss of a row is not as `expected`.
    pub(in crate::laws) fn bad_loss(p: &IsoFlopPoint, expected: &'static str) -> Self {
        let (run_id, metric) = (p.run_id.clone(), p.metric.clone());
        Self::BadLoss { run_id, metric, value: p.loss, expected }
    }
}

fn listed(budgets: &[f64]) -> String {
    budgets.iter().map(|budget| count(*budget)).collect::<Vec<_>>().join(", ")
}

impl IsoFlopPoint {
    /// Rejects a row whose logarithms do not exist, whose loss is no number or whose vocabulary is not
    /// as `parameters` says.
    pub(in crate::laws) fn check(&self, parameters: Parameters) -> Result<(), FitError> {
        let is_count = |v: f64| v.is_finite() && v > 0.0;
        let (is_vocab, of_vocab): (fn(f64) -> bool, _) = match parameters {
            Parameters::Split => (is_count, "finite and above 0"),
            Parameters::Total => (|v| v == 0.0, "0, since N alone is given"),
        };
        let counts = [
            ("budget_flops", self.budget_flops),
            ("flops", self.flops),
            ("params_nonvocab", self.params_nonvocab),
            ("tokens", self.tokens),
            ("weight", self.weight),
        ];
        let vocabulary = [("params_vocab", self.params_vocab), ("n_vocab", self.n_vocab)];
        let bad_count = counts.into_iter().find(|(_, v)| !is_count(*v));
        let bad_count = bad_count.map(|own| (own, "finite and above 0"));
        let bad_vocab = || vocabulary.into_iter().find(|(_, v)| !is_vocab(*v)).zip(Some(of_vocab));
        if let Some(((field, value), expected)) = bad_count.or_else(bad_vocab) {
            return Err(FitError::BadValue { run_id: self.run_id.clone(), field, value, expected });
        }
        if self.loss.is_finite() { Ok(()) } else { Err(FitError::bad_loss(self, "finite")) }
    }
}

/// The metric shared by all rows; the default without rows.
///
/// # Errors
/// [`FitError::Metrics`] for rows with different metrics.
pub(in crate::laws) fn metric_of(points: &[IsoFlopPoint]) -> Result<Metric, FitError> {
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
