//! What the loss of a model of some size holds; its fields are the keys of `predict --params --json`.

use serde::{Deserialize, Serialize};

use crate::laws::PerQuantity;

/// A model, and the tokens that it is trained on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelSize {
    /// N, or N_nv for laws that tell the vocabulary apart.
    pub params: f64,
    /// V, for laws that tell the vocabulary apart.
    pub n_vocab: Option<f64>,
    /// N_v in place of V.
    pub params_vocab: Option<f64>,
    /// D.
    pub tokens: f64,
}

/// The loss of a model on some tokens, beside that of the best model for the same FLOPs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SizedPrediction {
    /// Name of the laws.
    pub law: String,
    /// The law of N and D that was asked: `approach3`, `approach3-vocab`, `joint` or `joint-repeats`.
    pub form: String,
    /// The column or expression of a table that gives the loss; absent for L_u.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub loss_name: Option<String>,
    /// V is known if it was given or only one was tried.
    #[serde(flatten)]
    pub model: PerQuantity<f64>,
    /// C that the model spends on its tokens, as the law counts.
    pub flops: f64,
    pub loss_normalised: f64,
    /// The best model for `flops`, by the same law.
    pub optimum: SizedOptimum,
    /// `loss_normalised` less the optimum's.
    pub loss_above_optimum: f64,
    /// FLOPs with which the best model reaches `loss_normalised`.
    pub flops_of_equal_loss: Option<f64>,
    pub ci95: SizedIntervals,
    /// `flops` over the largest fitted budget.
    pub extrapolation_factor: f64,
    /// The smallest fitted budget over `flops`, where these lie below the fit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub below_fit: Option<f64>,
    /// Sentences for a person.
    pub warnings: Vec<String>,
}

/// The best model for a budget, under the names that [`SizedPrediction`] has.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SizedOptimum {
    #[serde(flatten)]
    pub at: PerQuantity<f64>,
    pub loss_normalised: f64,
}

/// 95 % bootstrap percentile intervals; absent if the law holds no bootstrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SizedIntervals {
    pub loss_normalised: Option<[f64; 2]>,
    pub optimum_loss: Option<[f64; 2]>,
    /// Of the difference, replicate by replicate.
    pub loss_above_optimum: Option<[f64; 2]>,
}
