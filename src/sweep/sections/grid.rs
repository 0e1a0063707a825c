//! The `grid` section, and the list of generators.

use std::borrow::Cow;
use std::collections::BTreeMap;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize};
use serde_yaml::Value;

use crate::spec::{GeneratorKind, QuantizerSection, QuantizerSpec, VocabularyError};
use crate::units::{Ways, named, number};

/// The `grid` section: its axes are crossed unless `zip` pairs them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GridSection {
    pub models: ModelList,
    /// Vocabularies: sizes, or FSQ levels. One tokenizer is trained for each. If a quantizer has several
    /// codebooks, the size is for one; `n_vocab` of a run counts the codes of all.
    pub vocab: Vec<VocabSpec>,
    /// Training budgets of a run, in FLOPs.
    #[serde(deserialize_with = "number::read")]
    #[schemars(inner(range(min = 1, max = 1e30)))]
    pub budgets: Vec<f64>,
    /// Fractions of the training split, e.g. `[0.25, 0.5, 1]`, crossed with the grid. Laws of minima use only the
    /// largest; the joint law uses all, to learn the worth of repeated data.
    #[serde(
        default = "whole",
        skip_serializing_if = "is_whole",
        deserialize_with = "number::read"
    )]
    #[schemars(inner(range(min = 1e-9, max = 1)))]
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
    #[schemars(inner(range(min = 1, max = 1e30)))]
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
    /// Axes that advance together; each other axis is a separate group.
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
    #[schemars(range(min = 1, max = 4096))]
    pub n_layer: usize,
    /// Heads of attention; `d_model` is divided among them.
    #[serde(deserialize_with = "number::read")]
    #[schemars(range(min = 1, max = 4096))]
    pub n_head: usize,
    /// Width of the model.
    #[serde(deserialize_with = "number::read")]
    #[schemars(range(min = 2, max = 1_048_576))]
    pub d_model: usize,
    /// Width of the feed-forward layer; where left out, 8d/3 (`swiglu`) or 4d (`gelu`), up to a
    /// multiple of `model.ffn_multiple`.
    #[serde(default, deserialize_with = "number::read")]
    #[schemars(range(min = 1, max = 4_194_304))]
    pub d_ff: Option<usize>,
}

/// A family of models: depth grows with width.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ModelRule {
    /// Widths: one model of each.
    #[serde(deserialize_with = "number::read")]
    #[schemars(inner(range(min = 2, max = 1_048_576)))]
    pub d_model: Vec<usize>,
    /// n_layer = max(1, round(d_model / `width_per_layer`)).
    #[serde(deserialize_with = "number::read")]
    #[schemars(range(min = 1, max = 1_048_576))]
    pub width_per_layer: usize,
    /// n_head = max(1, d_model / `head_dim`).
    #[serde(deserialize_with = "number::read")]
    #[schemars(range(min = 2, max = 1_048_576))]
    pub head_dim: usize,
}

/// A vocabulary: a nominal size, or FSQ levels.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum VocabSpec {
    /// FSQ: resolved to ScaMo's levels (Table 8); VQ: the number of codes.
    Size(#[schemars(range(min = 2, max = 16_777_216))] usize),
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
    #[schemars(inner(range(min = 2, max = 16_777_216)))]
    pub levels: Vec<usize>,
}

/// Kinds of generators: one, or a list.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Generators(pub Vec<GeneratorKind>);

impl Default for Generators {
    fn default() -> Self {
        Self(vec![GeneratorKind::default()])
    }
}

// Entries that may be written in more than one way.

macro_rules! read_in_ways {
    ($($type:ty),*) => {$(
        impl<'de> Deserialize<'de> for $type {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                Ways::read(deserializer)
            }
        }
    )*};
}
read_in_ways!(ModelList, VocabSpec, Generators);

impl Ways for ModelList {
    const EXPECTED: &'static str = "a list of models, the name of a list, or a rule over d_model";

    fn of_scalar(name: &Value) -> Option<Result<Self, String>> {
        name.as_str().map(|name| Ok(Self::Named(name.to_string())))
    }

    fn of_list<'de, D: Deserializer<'de>>(list: D) -> Option<Result<Self, D::Error>> {
        Some(Vec::deserialize(list).map(Self::List))
    }

    fn of_section<'de, D: Deserializer<'de>>(rule: D) -> Option<Result<Self, D::Error>> {
        Some(ModelRule::deserialize(rule).map(Self::Rule))
    }
}

impl Ways for VocabSpec {
    const EXPECTED: &'static str = "a number of codes, or `{levels: [8, 5, 5, 5]}`";

    fn of_scalar(size: &Value) -> Option<Result<Self, String>> {
        Some(number::whole(size).map(Self::Size))
    }

    fn of_section<'de, D: Deserializer<'de>>(levels: D) -> Option<Result<Self, D::Error>> {
        Some(LevelsSpec::deserialize(levels).map(Self::Levels))
    }
}

impl Ways for Generators {
    const EXPECTED: &'static str = "a kind of generator, or a list of kinds";

    fn of_scalar(kind: &Value) -> Option<Result<Self, String>> {
        named(kind).map(|kind| Ok(Self(vec![kind?])))
    }

    fn of_list<'de, D: Deserializer<'de>>(list: D) -> Option<Result<Self, D::Error>> {
        Some(Vec::deserialize(list).map(Self))
    }
}

impl JsonSchema for Generators {
    fn schema_name() -> Cow<'static, str> {
        "Generators".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let one = generator.subschema_for::<GeneratorKind>();
        json_schema!({"anyOf": [one, {"type": "array", "items": one}]})
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::{Clips, ScaleName, ScaleSpec};

    #[test]
    fn every_way_of_writing_an_entry_reads_back() {
        let clips = ["auto\n", "600\n"];
        for text in clips {
            let read: Clips = serde_yaml::from_str(text).unwrap();
            assert_eq!(serde_yaml::to_string(&read).unwrap(), text);
        }
        let vocab: Vec<VocabSpec> = serde_yaml::from_str("[64, 1e3, {levels: [8, 1e1]}]").unwrap();
        let scales: Vec<ScaleSpec> = serde_yaml::from_str("[mid, [1, 2, 1e1]]").unwrap();
        assert_eq!(scales, [ScaleSpec::Named(ScaleName::Mid), ScaleSpec::List(vec![1, 2, 10])]);
        let again = serde_yaml::to_string(&scales).unwrap();
        assert_eq!(serde_yaml::from_str::<Vec<ScaleSpec>>(&again).unwrap(), scales);
        let levels = VocabSpec::Levels(LevelsSpec { levels: vec![8, 10] });
        assert_eq!(vocab, [VocabSpec::Size(64), VocabSpec::Size(1000), levels]);
        let again = serde_yaml::to_string(&vocab).unwrap();
        assert_eq!(serde_yaml::from_str::<Vec<VocabSpec>>(&again).unwrap(), vocab);
    }

    #[test]
    fn an_entry_of_another_kind_is_told_what_may_stand_there() {
        let models = serde_yaml::from_str::<ModelList>("7").unwrap_err().to_string();
        assert!(models.contains("the name of a list"), "{models}");
        let vocab = serde_yaml::from_str::<VocabSpec>("-3").unwrap_err().to_string();
        assert!(vocab.contains("expected a whole number, found `-3`"), "{vocab}");
        let clips = serde_yaml::from_str::<Clips>("many").unwrap_err().to_string();
        assert!(clips.contains("found `many`; or write `auto`"), "{clips}");
    }
}
