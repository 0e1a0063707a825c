//! From laws and a budget to a configuration: pure functions over values.
//!
//! `Laws → raw values at C → projected onto C → nearest buildable shape`, gathered in a
//! [`Prediction`]. Laws of N and D also predict the loss of a model that is not the best one for its FLOPs:
//! [`predict_sized`].
//!
//! # Example
//!
//! ```
//! use isoflop_laws::laws::scamo;
//! use isoflop_laws::predict::{PredictOptions, predict};
//!
//! // The optimum for 1e18 FLOPs by ScaMo's published laws.
//! let best = predict(&scamo(), 1e18, &PredictOptions::default())?;
//! let [size, vocab, tokens] =
//!     [best.at.params_nonvocab, best.at.params_vocab, best.at.tokens].map(Option::unwrap);
//! assert!((6.0 * (size + vocab) * tokens / 1e18 - 1.0).abs() < 1e-6, "N and D spend the budget");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod allocation;
mod optimum;
mod several;
mod shapes;
mod sized;
#[cfg(test)]
mod tests;
mod warnings;

pub use allocation::{Allocation, project};
pub use optimum::predict;
pub use shapes::{Codebook, Shape, default_ladder, ladder_of};
pub use sized::{ModelSize, SizedIntervals, SizedOptimum, SizedPrediction, predict_sized};

use serde::{Deserialize, Serialize};

use crate::laws::text::count;
use crate::laws::{Candidate, PerQuantity};

// What a prediction holds; its fields are the keys of `isoflop predict --json`.

/// The optimal configuration for a budget.
///
/// `spends_flops` and `budget_ratio` describe the raw laws, before the projection: after it the
/// allocation spends `budget_flops` by construction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Prediction {
    /// C.
    pub budget_flops: f64,
    /// Name of the laws.
    pub law: String,
    /// On the budget. V = N_v/d, d being the width of `shape`; it is not rounded to a codebook, and absent in
    /// laws that were not fitted to a sweep.
    #[serde(flatten)]
    pub at: PerQuantity<f64>,
    /// The loss by the recommended law: L_u in nats, or what `loss_name` says in its unit.
    pub loss_normalised: Option<f64>,
    /// The column or expression of a table that gives the loss; absent for L_u.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub loss_name: Option<String>,
    /// The law that gave the loss, and, where it is a joint one, the allocation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recommended: Option<Candidate>,
    /// Beyond the fit, where several laws were tested: what they say together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub together: Option<Together>,
    /// 95 % bootstrap percentile intervals.
    pub ci95: Intervals,
    /// FLOPs that the raw laws spend at C, by the options' count.
    pub spends_flops: f64,
    /// `spends_flops` / `budget_flops`.
    pub budget_ratio: f64,
    /// C over the largest fitted budget; over C0 for a published law.
    pub extrapolation_factor: f64,
    /// The smallest fitted budget over C, where C lies below the fit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub below_fit: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape: Option<PredictedShape>,
    /// Sentences for a person.
    pub warnings: Vec<String>,
    pub raw: Raw,
}

/// A forecast beyond the fit by every law that was tested: the centre of the mixture that the intervals are of.
///
/// Loss, and N_nv, N_v and D in their logarithms, are the means by the laws' weights, brought onto the
/// budget (Bates and Granger 1969); docs/which-law.md has how it did beside the recommended law.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Together {
    /// The heaviest first.
    pub laws: Vec<Weighed>,
    pub loss_normalised: f64,
    #[serde(flatten)]
    pub at: PerQuantity<f64>,
}

/// A law in a forecast of several.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Weighed {
    pub law: Candidate,
    /// The weights of a forecast sum to 1, except for laws below half a percent.
    pub weight: f64,
}

/// 95 % percentile intervals over the bootstrap of the laws; absent if they hold no bootstrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Intervals {
    #[serde(flatten)]
    pub at: PerQuantity<[f64; 2]>,
    /// On the clips that the runs were measured on.
    pub loss_normalised: Option<[f64; 2]>,
    /// On other clips of their kind; absent if it is not known which were recorded together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub loss_on_other_clips: Option<[f64; 2]>,
    /// Interval of the floor law's loss.
    #[serde(default)]
    pub loss_floor: Option<[f64; 2]>,
}

/// The nearest shape and vocabulary that can be built.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PredictedShape {
    pub n_layer: u64,
    pub n_head: u64,
    pub d_model: u64,
    pub n_vocab: u64,
    /// FSQ levels whose product is `n_vocab`; empty if the vocabulary is the trainer's own, or the only
    /// one that was tried and no such product.
    pub levels: Vec<u32>,
}

/// The laws' own values at C, before the projection.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Raw {
    #[serde(flatten)]
    pub at: PerQuantity<f64>,
    /// The same as [`Prediction::spends_flops`].
    pub spends_flops: f64,
    /// L_u by the log law.
    pub loss_log: Option<f64>,
    /// L_u by the floor law.
    pub loss_floor: Option<f64>,
    /// L_u by the joint law at its own optimum.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub loss_joint: Option<f64>,
}

// What a prediction may choose from, and how it counts.

/// The count of training FLOPs that a prediction is projected with, under one rule.
///
/// Under `6nd` the count depends on N_nv, N_v and D alone. The others also depend on a model's
/// shape, which this module knows nothing of: a caller hands their count in as a closure.
#[derive(Clone, Copy)]
pub struct FlopCount<'a> {
    /// `openai`, `6nd` or `exact`.
    pub rule: &'a str,
    /// Function of N_nv, N_v and D; must grow with each.
    pub flops: &'a (dyn Fn(f64, f64, f64) -> f64 + Sync),
}

impl FlopCount<'static> {
    /// 6(N_nv + N_v)D (ScaMo Eq. 7).
    pub const SIX_ND: Self = Self { rule: "6nd", flops: &|n, v, d| 6.0 * (n + v) * d };
}

/// The options of [`predict`](super::predict).
#[derive(Clone, Copy)]
pub struct PredictOptions<'a> {
    /// Should count by the rule that the laws are written in; a warning says where it does not.
    pub flop_count: FlopCount<'a>,
    /// The shapes that can be built.
    pub shapes: &'a [Shape],
}

impl Default for PredictOptions<'static> {
    /// The rule `6nd` and the [`default_ladder`].
    fn default() -> Self {
        Self { flop_count: FlopCount::SIX_ND, shapes: default_ladder() }
    }
}

/// Why [`predict`](super::predict) gave no prediction.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PredictError {
    #[error("budget {0:e} FLOPs cannot be predicted for: give a finite number above 0")]
    BadBudget(f64),

    #[error("{laws} holds no law of {quantity}, so no optimum can be predicted; refit the sweep")]
    MissingLaw { laws: String, quantity: &'static str },

    #[error("the laws of {laws} leave the range of numbers at {} FLOPs; give a nearer one", count(*.budget))]
    OutOfRange { laws: String, budget: f64 },

    #[error(
        "the joint law of {laws} has no optimum at {} FLOPs between the {what} {} and {}, 8 times \
         below what was tried and far above it: give a budget nearer to the runs, or add runs on both sides of \
         the best {what} of each budget", count(*.budget), count(*.low), count(*.high)
    )]
    NoOptimum { laws: String, budget: f64, what: &'static str, low: f64, high: f64 },

    #[error(
        "no scale of the optimum spends {budget:e} FLOPs under rule {rule}; \
         its count must grow with the model and with the tokens"
    )]
    NotProjected { budget: f64, rule: String },

    #[error(
        "{laws} knows the loss of compute-optimal models only, not that of any N and D; fit a law that \
         does: `isoflop fit TABLE --law approach3 --out laws.json`, or `isoflop fit RESULTS` of a \
         sweep with four budgets or more, which gives a joint law"
    )]
    NoLossLaw { laws: String },

    #[error("the law of {laws} tells the vocabulary apart: --params is N_nv, and it needs {needs}")]
    NoVocabulary { laws: String, needs: &'static str },

    #[error("the law of {laws} knows no vocabulary: leave out --vocab and --params-vocab")]
    VocabularyUnknown { laws: String },

    #[error("no {0} to choose from: give at least one in the options")]
    NothingToChoose(&'static str),
}
