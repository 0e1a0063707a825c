//! Who trains: the `trainer` section.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};
use serde_yaml::Value;

use super::Word;

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
