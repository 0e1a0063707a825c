//! Who trains: the `trainer` section.

use std::fmt;
use std::path::PathBuf;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use serde_yaml::Value;

use super::Word;
use crate::units::number;

/// A program that trains each run in place of the built-in trainer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrainerSection {
    /// The program and its arguments, with `{spec}`, `{out}`, `{checkpoint}` and `{init}` in them
    /// (docs/custom-trainer.md); or `torch` with its options, the trainer in PyTorch that comes with isoflop
    /// (docs/torch.md).
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

impl TrainerSection {
    /// A program by its command alone.
    fn of_command(command: &str) -> Self {
        let command = command.to_string();
        Self { command, revision: None, inputs: Vec::new(), canary: true, gpus: None }
    }
}

/// Reads a section, or the command that stands for it: `trainer: torch`.
pub fn section_or_command<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<TrainerSection>, D::Error> {
    struct Either;
    impl<'de> Visitor<'de> for Either {
        type Value = Option<TrainerSection>;

        fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
            f.write_str("a section, or a command")
        }

        fn visit_unit<E: Error>(self) -> Result<Self::Value, E> {
            Ok(None)
        }

        fn visit_str<E: Error>(self, command: &str) -> Result<Self::Value, E> {
            Ok(Some(TrainerSection::of_command(command)))
        }

        fn visit_map<A: MapAccess<'de>>(self, section: A) -> Result<Self::Value, A::Error> {
            TrainerSection::deserialize(MapAccessDeserializer::new(section)).map(Some)
        }
    }
    deserializer.deserialize_any(Either)
}

/// Both ways of writing it.
pub fn section_or_command_schema(generator: &mut SchemaGenerator) -> Schema {
    let section = generator.subschema_for::<TrainerSection>();
    let command = "The command alone; `torch` is the trainer in PyTorch that comes with isoflop.";
    json_schema!({"anyOf": [{"type": "string", "description": command}, section, {"type": "null"}]})
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
        _ => Err(Error::custom("expected a word or a number")),
    }
}
