//! What a prediction holds; its fields are the keys of `isoflop predict --json`.

use serde::{Deserialize, Serialize};

use crate::laws::{Candidate, PerQuantity};

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
    /// Those of a forecast sum to 1, but for laws below half a percent.
    pub weight: f64,
}

/// 95 % percentile intervals over the bootstrap of the laws; absent where they hold no bootstrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Intervals {
    #[serde(flatten)]
    pub at: PerQuantity<[f64; 2]>,
    /// On the clips that the runs were measured on.
    pub loss_normalised: Option<[f64; 2]>,
    /// On other clips of their kind; absent where it is not known which were recorded together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub loss_on_other_clips: Option<[f64; 2]>,
    /// Of the floor law's loss.
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
    /// FSQ levels whose product is `n_vocab`; empty where the vocabulary is the trainer's own, or the only
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
