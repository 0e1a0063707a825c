//! How far laws are to be believed: what `laws.json` holds of it.

use serde::{Deserialize, Serialize};

use super::validated::Validated;
use crate::laws::joint::law::JointLaw;
use crate::laws::minima::types::LackOfFit;
use crate::laws::noise::test_noise::TestNoise;
use crate::laws::noise::tokenizer_noise::TokenizerNoise;
use crate::laws::ranking::forecast_error::ForecastError;
use crate::laws::ranking::recommended::Recommended;

/// How far laws are to be believed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Judgement {
    /// The law that predicts best.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recommended: Option<Recommended>,
    /// How its misses grow with the distance from its fit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub forecast_error: Option<ForecastError>,
    /// One smooth loss over all cells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint: Option<JointLaw>,
    pub lack_of_fit: Vec<LackOfFit>,
    /// The scatter of tokenizers; absent where each vocabulary has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tokenizer_noise: Option<TokenizerNoise>,
    /// What other clips to test on would do; absent where it is not known which were recorded together.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub test_noise: Option<TestNoise>,
    /// What the intervals of the exponents are made of.
    pub interval_parts: Vec<IntervalPart>,
    /// Forecasts that runs have tested.
    pub validations: Vec<Validated>,
    /// What is likely wrong with all rows of a table, in sentences.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub rows: Vec<String>,
    /// What the runs tried.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tried: Option<Tried>,
}

/// The extent of the runs that laws rest on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tried {
    /// Runs, and the budgets that they are of; 0 in a file that does not know them.
    #[serde(default)]
    pub runs: usize,
    #[serde(default)]
    pub n_budgets: usize,
    /// The smallest and the largest budget; zeros in a file that does not know them.
    #[serde(default)]
    pub budgets: [f64; 2],
    /// The smallest and the largest N_nv, or N.
    pub sizes: [f64; 2],
    /// The smallest and the largest V; zeros where it is not known.
    pub vocabularies: [f64; 2],
    /// Layers of every model, where all have as many.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub n_layer: Option<usize>,
    /// Distinct tokens of the training split, where they are known.
    pub unique_tokens: Option<f64>,
    /// The most passes over them.
    pub epochs: Option<f64>,
}

/// The interval of an exponent, had it one reason alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct IntervalPart {
    /// `runs`, `tokenizers`, `misfit`, `method`, `test split`.
    pub part: String,
    /// Of N_nv's exponent, or N's.
    pub exponent_nonvocab: Option<[f64; 2]>,
    pub exponent_vocab: Option<[f64; 2]>,
    pub exponent_tokens: Option<[f64; 2]>,
    pub slope_per_decade: Option<[f64; 2]>,
}
