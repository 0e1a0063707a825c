//! Who trains: the `trainer` section.

use std::path::PathBuf;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize};
use serde_yaml::Value;

use super::Word;
use crate::units::{Ways, number};

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
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "number::read")]
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

impl Ways for TrainerSection {
    const EXPECTED: &'static str = "a section, or a command";

    fn of_scalar(command: &Value) -> Option<Result<Self, String>> {
        command.as_str().map(|command| Ok(Self::of_command(command)))
    }

    fn of_section<'de, D: Deserializer<'de>>(section: D) -> Option<Result<Self, D::Error>> {
        Some(Self::deserialize(section))
    }
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
    Ok(Option::<Word>::deserialize(deserializer)?.map(|word| word.0))
}
