//! Who trains: the `trainer` section.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};
use serde_yaml::Value;

use super::Word;
use crate::units::number;

/// A program that trains each run in place of the built-in trainer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrainerSection {
    /// The program and its arguments, with `{spec}`, `{out}` and `{checkpoint}` in them
    /// (docs/custom-trainer.md).
    pub command: String,
    /// Anything, as `2`: a change trains every run again, as a change of the command does.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "scalar")]
    #[schemars(with = "Option<Word>")]
    pub revision: Option<String>,
    /// Files of the program: a change of one trains every run again.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub inputs: Vec<PathBuf>,
    /// Train the cheapest run by itself first, and the others only once it has ended well.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub canary: bool,
    /// GPUs that runs side by side share: each run sees its own by `CUDA_VISIBLE_DEVICES`.
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "number::optional_count"
    )]
    #[schemars(with = "Option<usize>")]
    pub gpus: Option<usize>,
}

fn yes() -> bool {
    true
}

/// Whether it is the default, which a resolved sweep does not repeat.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn is_yes(flag: &bool) -> bool {
    *flag
}

/// A word or a number, as text.
fn scalar<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<String>, D::Error> {
    match Value::deserialize(deserializer)? {
        Value::Null => Ok(None),
        Value::String(text) => Ok(Some(text)),
        Value::Number(number) => Ok(Some(number.to_string())),
        _ => Err(serde::de::Error::custom("expected a word or a number")),
    }
}
