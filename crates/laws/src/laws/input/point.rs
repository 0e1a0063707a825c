//! [`IsoFlopPoint`]: a run as the laws see it.

use super::metric::Metric;
use serde::{Deserialize, Serialize};

/// One finished run as the laws see it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct IsoFlopPoint {
    pub run_id: String,
    pub seed: u64,
    /// The declared budget: runs are grouped by it.
    pub budget_flops: f64,
    /// What the run spent under the rule that the fit uses.
    pub flops: f64,
    /// N_nv.
    pub params_nonvocab: f64,
    /// N_v = V·d.
    pub params_vocab: f64,
    /// V.
    pub n_vocab: f64,
    /// D.
    pub tokens: f64,
    /// Which loss this is.
    pub metric: Metric,
    /// The loss; lower is better. L_u is in nats, and 0 for the unigram model.
    pub loss: f64,
    /// How much the run counts in means and fits, relative to the others; 1 by default.
    pub weight: f64,
    /// What no law is written in, but some judge the runs by.
    #[serde(default)]
    pub about: RunFacts,
}

/// What may be known of a run beside its point; a table made elsewhere knows none of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunFacts {
    /// Blocks of the model.
    pub n_layer: Option<usize>,
    /// The tokenizer that made its codes, by id.
    pub tokenizer: Option<String>,
    /// Distinct tokens of what it saw of the training split: a run of more tokens repeats them.
    pub unique_tokens: Option<f64>,
    /// What it saw of the training split, 1 being all.
    #[serde(default)]
    pub share: Option<f64>,
    /// The loss on each block of the test split, less their mean; empty where it is not known. Blocks have
    /// no recording in common, and are the same for all runs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub by_block: Vec<f64>,
}

impl IsoFlopPoint {
    /// What it saw of the training split; all of it where nothing else is known.
    pub fn share(&self) -> f64 {
        self.about.share.unwrap_or(1.0)
    }
}

/// Whether a table tells a model's parameters apart by the vocabulary.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Parameters {
    /// N_nv and N_v each have a column.
    #[default]
    Split,
    /// Only N is known. In points and minima it stands where N_nv does, and N_v and V are 0; among
    /// the laws it has a place of its own, [`PowerLaws::params`](crate::laws::lines::types::PowerLaws::params).
    Total,
}

impl Parameters {
    /// The symbol of a model's size.
    pub fn size(self) -> &'static str {
        match self {
            Self::Split => "N_nv",
            Self::Total => "N",
        }
    }
}
