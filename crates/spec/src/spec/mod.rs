//! Specifications of training: plain data, closed, hashable, without burn.
//!
//! A kind is a variant of a tagged enum: [`GeneratorSpec`], [`ArchitectureSpec`], [`QuantizerSpec`],
//! [`TextSpec`]. The spec has methods for everything that depends on the kind; only the module that builds a kind
//! matches on it.
//!
//! # Example
//!
//! ```
//! use isoflop_spec::spec::{levels_for, n_codes};
//!
//! // ScaMo's 2^8 codes are 8 · 6 · 5.
//! let levels = levels_for(256).expect("a size of Table 8");
//! assert_eq!((levels, n_codes(levels)), (&[8, 6, 5][..], 240));
//! ```

/// Checks that keys of a section stand there only where what they belong to holds.
macro_rules! belonging {
    ($section:expr, $prefix:literal; $($holds:expr, $problem:expr => $($key:ident),*;)*) => {
        [$($((
            $holds || $section.$key.is_none(),
            concat!($prefix, stringify!($key)),
            $problem,
        ),)*)*]
    };
}

/// Checks of the values of keys.
macro_rules! each {
    ($section:expr; $($holds:expr, $problem:expr => $($key:ident),*;)*) => {
        [$($(($holds($section.$key), stringify!($key), $problem),)*)*]
    };
}

mod data;
mod evaluator;
pub mod generator;
mod quantizer;
mod run;
mod tokenizer;

use schemars::{JsonSchema, schema_for};
use serde::Serialize;
use serde_json::Value;

use crate::units::ranges;

pub use data::{
    BrokenFiles, Clips, DataSection, DataSource, LongClips, MemberSection, Origin, Representation,
    TextEncoderKind, TextSpec, TextStates,
};
pub use evaluator::{
    EVALUATOR_REVISION, EvaluatorFeatures, EvaluatorKind, EvaluatorSection, EvaluatorSpec,
    LoadedSpec, MatchingSpec, Mismatches, MotionClipSpec, NetworksSpec,
};
pub use generator::flops;
pub use generator::{
    ClipShape, Context, Ffn, FlopsPerToken, FlopsRule, GeneratorKind, GeneratorSpec, MaskedSpec,
    ModelShape, ParamCounts, Places, Pricing, Scales, ScalewiseSpec, TARGETS_PER_PASS,
    exact_of_clip,
};
pub use quantizer::{
    CodebookKind, CodebookSpec, Grid, Length, MultiscaleSpec, QuantizerKind, QuantizerSection,
    QuantizerSpec, ResidualSpec, Scale, ScaleName, ScaleSpec, VocabularyError, digits_of_index,
    index_of_digits, levels_for, n_codes, nominal_sizes,
};
pub use run::{
    Precision, RunSpec, SamplingSpec, ScoresSpec, Share, ShownCaptions, TRAINING_REVISION,
    TokenizerJob, TrainerProgram, is_torch,
};
pub use tokenizer::{
    ArchitectureSpec, BegunFrom, Codes, ConvolutionalSpec, Detokenizer, LanguagePlace,
    LanguageSection, LanguageSpec, PatchSpec, Piece, Plateau, Positions, TokenizerKind,
    TokenizerLoss, TokenizerNorm, TokenizerSchedule, TokenizerSection, TokenizerSpec,
    TokenizerTrainer, TokenizerTraining, TransformerSpec,
};

// What will not do.

/// A field of a description has a value that no training can use.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("tokenizer.{field}: {problem}")]
pub struct SpecError {
    pub field: String,
    pub problem: String,
}

/// A key of a section that will not do, and how to mend it; an empty field is the section itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeyProblem {
    pub field: String,
    pub problem: String,
    pub help: Option<&'static str>,
}

impl From<KeyProblem> for SpecError {
    fn from(KeyProblem { field, problem, .. }: KeyProblem) -> Self {
        Self { field, problem }
    }
}

impl KeyProblem {
    /// The checks that do not hold.
    pub fn failed(
        checks: impl IntoIterator<Item = (bool, &'static str, &'static str, Option<&'static str>)>,
    ) -> Vec<Self> {
        let failed = checks.into_iter().filter(|(holds, ..)| !holds);
        failed
            .map(|(_, field, problem, help)| Self {
                field: field.into(),
                problem: problem.into(),
                help,
            })
            .collect()
    }
}

/// Numbers of a resolved description that lie outside the range of the key of that name in the section `S`: such
/// a description may come from a file that no sweep was read from.
fn out_of_range<S: JsonSchema>(part: &impl Serialize) -> Vec<KeyProblem> {
    let value = serde_yaml::to_value(part).expect("specs are plain values");
    let found = ranges::outside(&schema_for!(S).to_value(), &value).into_iter();
    found.map(|(field, problem)| KeyProblem { field, problem, help: None }).collect()
}

/// The checks that do not hold, of such that need no help.
fn failed<const N: usize>(checks: [(bool, &'static str, &'static str); N]) -> Vec<KeyProblem> {
    KeyProblem::failed(checks.map(|(holds, field, problem)| (holds, field, problem, None)))
}

/// An error unless a condition holds.
fn require(holds: bool, field: &'static str, problem: &str) -> Result<(), SpecError> {
    if holds { Ok(()) } else { Err(SpecError { field: field.into(), problem: problem.into() }) }
}

/// The first check that does not hold.
fn require_all<const N: usize>(checks: [(bool, &'static str, &str); N]) -> Result<(), SpecError> {
    checks.into_iter().try_for_each(|(holds, field, problem)| require(holds, field, problem))
}

// Ids by content, and what differs between two specs.

/// The fields of two specs of a kind that differ, by path: `lr`, `model.d_ff`.
pub fn changed_fields<T: Serialize>(ours: &T, theirs: &T) -> Vec<String> {
    let value = |spec: &T| serde_json::to_value(spec).expect("specs are plain values");
    let mut changed = Vec::new();
    differences("", &value(ours), &value(theirs), &mut changed);
    changed
}

fn differences(path: &str, ours: &Value, theirs: &Value, changed: &mut Vec<String>) {
    match (ours, theirs) {
        (Value::Object(ours), Value::Object(theirs)) => {
            let only_theirs = theirs.keys().filter(|name| !ours.contains_key(*name));
            for name in ours.keys().chain(only_theirs) {
                let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
                let [ours, theirs] =
                    [ours, theirs].map(|keys| keys.get(name).unwrap_or(&Value::Null));
                differences(&path, ours, theirs, changed);
            }
        }
        _ if ours != theirs => changed.push(path.to_string()),
        _ => {}
    }
}

/// Sixteen hex digits of the blake3 hash of a value's JSON, whose fields stand in a fixed order.
pub fn content_id(value: &impl Serialize) -> String {
    let json = serde_json::to_string(value).expect("specs are plain values");
    blake3::hash(json.as_bytes()).to_hex()[..16].to_string()
}
