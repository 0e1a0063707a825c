//! [`Sweep`]: a sweep file with all defaults filled in.

mod engine;
mod grid;
mod trainer;
mod training;

pub use engine::*;
pub use grid::*;
pub use trainer::*;
pub use training::*;

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use crate::laws::MinimumMethod::{self, Argmin, Cubic, Parabola, Surface};
use crate::spec::{
    DataSection, DataSource, EvaluatorSection, FlopsRule, QuantizerSpec, SamplingSpec, ScoresSpec,
    TextSpec, TokenizerSection, VocabularyError,
};
use crate::units::number::{self, Written, plain};
use crate::units::{Ways, section};

plain!(ScheduleKind, ScheduleSection, RateParams);

/// Sections that can be written as a number or a command.
macro_rules! short {
    ($($type:ty),*) => {$(
        impl Written for $type {
            fn written<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                Ways::read(deserializer)
            }
        }
    )*};
}
short!(LrRule, BatchRule, TrainerSection);

/// A study: a grid of models, vocabularies and budgets, and how each cell is trained and judged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sweep {
    /// A sweep by name (docs/presets.md), which the keys of the file are laid over: sections key by key,
    /// all else whole; of a section with another `kind` than here, nothing is kept.
    #[serde(default, skip_serializing)]
    pub preset: Option<String>,
    /// A sweep file, from the folder of this one, which the keys of this one are laid over in the same
    /// way; it may name a preset, and include another.
    #[serde(default, skip_serializing)]
    pub include: Option<PathBuf>,
    /// Names the folder of the results: letters, digits, `-`, `_` and `.`.
    pub name: String,
    /// Every cell is trained once a seed.
    #[serde(default = "default_seeds")]
    #[schemars(inner(range(min = 0, max = 18_446_744_073_709_551_615u64)))]
    pub seeds: Vec<u64>,
    #[serde(default)]
    pub data: DataSection,
    #[serde(default)]
    pub text: TextSpec,
    #[serde(default)]
    pub tokenizer: TokenizerSection,
    /// The kind of generator, or a list of kinds: an axis of the grid.
    #[serde(default)]
    pub generator: Generators,
    pub grid: GridSection,
    #[serde(default)]
    pub flops: FlopsSection,
    #[serde(default)]
    pub model: ModelSection,
    #[serde(default)]
    pub train: TrainSection,
    /// Trains the runs in place of the built-in trainer.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "number::read")]
    #[schemars(schema_with = "section_or_command_schema")]
    pub trainer: Option<TrainerSection>,
    /// The evaluator of motions; if absent, none is trained.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub evaluator: Option<EvaluatorSection>,
    /// How motions are made by default.
    #[serde(default, skip_serializing_if = "number::is_default")]
    pub sampling: SamplingSpec,
    /// The runs to score, and how; if absent, none is scored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scores: Option<ScoresSpec>,
    #[serde(default)]
    pub fit: FitSection,
    #[serde(default)]
    pub predict: PredictSection,
    /// How engines other than this machine are to be used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub engine: Option<EngineSection>,
}

impl Sweep {
    /// The quantizer of a vocabulary of the grid. Where no tokenizer is trained (`data: {source: none}`), a size
    /// is taken as it is written.
    ///
    /// # Errors
    /// There is none.
    pub fn quantizer(&self, entry: &VocabSpec) -> Result<QuantizerSpec, VocabularyError> {
        let section = self.tokenizer.quantizer();
        match entry {
            VocabSpec::Size(n) if !self.has_tokenizers() => section.of_codes(*n),
            _ => entry.quantizer(&section),
        }
    }

    /// Whether a tokenizer is trained for each vocabulary: not if a trainer brings its own data.
    pub fn has_tokenizers(&self) -> bool {
        self.data.source != DataSource::None || !self.data.union.is_empty()
    }
}

fn default_seeds() -> Vec<u64> {
    vec![0]
}

// Results made from the runs.

section! {
    /// The `flops` section: how FLOPs are counted.
    pub struct FlopsSection {
        rule: FlopsRule = FlopsRule::default();
    }
}

/// The budget left out of the fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum HoldOutSpec {
    /// The largest. The laws of the others are tested on it.
    #[default]
    LargestBudget,
    /// All are fitted, and none is left to test the laws on.
    None,
}

/// The `fit` section: how laws are fitted to the runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FitSection {
    /// How the minimum of each budget is found: the laws go through the parabolas, or through the
    /// best runs where too few parabolas can be trusted, and the others stand beside them.
    pub minima: Vec<MinimumMethod>,
    pub hold_out: HoldOutSpec,
    /// Bootstrap replicates for the intervals.
    #[serde(deserialize_with = "number::read")]
    #[schemars(range(min = 0, max = 1_000_000))]
    pub bootstrap: usize,
}

impl Default for FitSection {
    fn default() -> Self {
        let minima = vec![Parabola, Argmin, Cubic, Surface];
        Self { minima, hold_out: HoldOutSpec::default(), bootstrap: 1000 }
    }
}

section! {
    /// The `predict` section: predictions to make at the end.
    pub struct PredictSection {
        /// Budgets, in FLOPs, of which the best configuration is given.
        #[schemars(inner(range(min = 1, max = 1e30)))]
        budgets: Vec<f64> = Vec::new();
    }
}
