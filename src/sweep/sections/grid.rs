//! What a sweep varies: the `grid` section.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::spec::{QuantizerSection, QuantizerSpec, VocabularyError};
use crate::units::number;

/// The `grid` section: its axes are crossed unless `zip` pairs them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GridSection {
    pub models: ModelList,
    /// Vocabularies: sizes, or FSQ levels. One tokenizer is trained for each. Where a quantizer has several
    /// codebooks, the size is that of one; `n_vocab` of a run counts the codes of all.
    pub vocab: Vec<VocabSpec>,
    /// Training budgets of a run, in FLOPs.
    #[serde(deserialize_with = "number::read")]
    pub budgets: Vec<f64>,
    /// Shares of the training split that runs see, as `[0.25, 0.5, 1]`, crossed with the grid. Laws of the
    /// minimum take the largest alone; the joint law takes all, and learns from them what repeated data is
    /// worth.
    #[serde(
        default = "whole",
        skip_serializing_if = "is_whole",
        deserialize_with = "number::read"
    )]
    pub shares: Vec<f64>,
    /// Groups of axes that advance together, as `[[models, budgets]]`; of one length each.
    #[serde(default)]
    pub zip: Vec<Vec<Axis>>,
    /// Conditions, as `n_vocab > 1000 and d_model < 64`; a cell that meets one is left out.
    #[serde(default)]
    pub exclude: Vec<String>,
    /// Other keys as axes, as `train.lr: [1e-3, 3e-3]`: keys of `train`, `model` and `tokenizer`, crossed with
    /// one another and with the grid. The laws take each cell at the best of them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub vary: BTreeMap<String, Vec<serde_json::Value>>,
    /// Further parts, whose axes are crossed by themselves; `isoflop fit --next` writes such. A cell that is
    /// there already is not trained twice.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub also: Vec<GridPart>,
}

/// A part of the grid: its axes are crossed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GridPart {
    pub models: ModelList,
    /// Vocabularies, as in `grid.vocab`.
    pub vocab: Vec<VocabSpec>,
    /// Training budgets, in FLOPs.
    #[serde(deserialize_with = "number::read")]
    pub budgets: Vec<f64>,
}

/// All of the training split.
fn whole() -> Vec<f64> {
    vec![1.0]
}

fn is_whole(shares: &Vec<f64>) -> bool {
    *shares == whole()
}

impl GridPart {
    /// The grid of this part alone.
    pub fn alone(&self) -> GridSection {
        let Self { models, vocab, budgets } = self.clone();
        GridSection {
            models,
            vocab,
            budgets,
            shares: whole(),
            zip: Vec::new(),
            exclude: Vec::new(),
            vary: BTreeMap::new(),
            also: Vec::new(),
        }
    }
}

/// An axis of the grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// `grid.models`.
    Models,
    /// `grid.vocab`.
    Vocab,
    /// `grid.budgets`.
    Budgets,
}

impl Axis {
    /// Axes that advance together; each of the others is a group of its own.
    pub fn groups(zip: &[Vec<Self>]) -> Vec<Vec<Self>> {
        let is_alone = |axis: &Self| !zip.iter().flatten().any(|other| other == axis);
        let alone = [Self::Models, Self::Vocab, Self::Budgets].into_iter().filter(is_alone);
        let zipped = zip.iter().filter(|group| !group.is_empty()).cloned();
        alone.map(|axis| vec![axis]).chain(zipped).collect()
    }
}

/// Models in full, by name, or by a rule over d_model.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum ModelList {
    /// `scamo`: the six rows of its Table 1.
    Named(String),
    /// One model after another.
    List(Vec<ModelEntry>),
    /// Widths, and the depth and the heads that follow from them.
    Rule(ModelRule),
}

/// One model.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ModelEntry {
    /// Blocks.
    #[serde(deserialize_with = "number::read")]
    pub n_layer: usize,
    /// Heads of attention; `d_model` is divided among them.
    #[serde(deserialize_with = "number::read")]
    pub n_head: usize,
    /// Width of the model.
    #[serde(deserialize_with = "number::read")]
    pub d_model: usize,
    /// Width of the feed-forward layer; where left out, 8d/3 (`swiglu`) or 4d (`gelu`), up to a
    /// multiple of `model.ffn_multiple`.
    #[serde(default, deserialize_with = "number::read")]
    pub d_ff: Option<usize>,
}

/// A family of models: depth grows with width.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ModelRule {
    /// Widths: one model of each.
    #[serde(deserialize_with = "number::read")]
    pub d_model: Vec<usize>,
    /// n_layer = max(1, round(d_model / `width_per_layer`)).
    #[serde(deserialize_with = "number::read")]
    pub width_per_layer: usize,
    /// n_head = max(1, d_model / `head_dim`).
    #[serde(deserialize_with = "number::read")]
    pub head_dim: usize,
}

/// A vocabulary: a nominal size, or FSQ levels.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum VocabSpec {
    /// FSQ: resolved to ScaMo's levels (Table 8); VQ: the number of codes.
    Size(usize),
    /// FSQ with other levels.
    Levels(LevelsSpec),
}

impl VocabSpec {
    /// The quantizer of a section whose codebooks have this vocabulary.
    ///
    /// # Errors
    /// There is none.
    pub fn quantizer(&self, section: &QuantizerSection) -> Result<QuantizerSpec, VocabularyError> {
        match self {
            Self::Size(n) => section.of_size(*n),
            Self::Levels(spec) => section.of_levels(&spec.levels),
        }
    }
}

/// FSQ levels in full: `{levels: [8, 5, 5, 5]}`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LevelsSpec {
    /// Values in each dimension; their product is the size of the vocabulary.
    #[serde(deserialize_with = "number::read")]
    pub levels: Vec<usize>,
}
