//! The `trainer` section, and its command, split into words without a shell.

use std::path::PathBuf;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize};
use serde_yaml::Value;

use super::engine::Word;
use crate::spec::is_torch;
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
    #[schemars(range(min = 1, max = 65_536))]
    pub gpus: Option<usize>,
}

impl Ways for TrainerSection {
    const EXPECTED: &'static str = "a section, or a command";

    fn of_scalar(command: &Value) -> Option<Result<Self, String>> {
        let command = command.as_str()?.to_string();
        Some(Ok(Self { command, revision: None, inputs: Vec::new(), canary: true, gpus: None }))
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

/// The placeholders of a command.
pub const PLACEHOLDERS: [&str; 4] = ["spec", "out", "checkpoint", "init"];

/// Required placeholders: the input and the output of a trainer.
const NEEDED: [&str; 2] = ["spec", "out"];

/// How it is started; `{python}` is an interpreter.
const TORCH_COMMAND: &str = "{python} -m isoflop.torch --spec {spec} --out {out} \
                             --checkpoint {checkpoint} --init {init}";

/// Why a command will not do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CommandError {
    #[error("an empty command trains nothing")]
    Empty,
    #[error("a quote is not closed, or a backslash ends the command")]
    Quotes,
    #[error("unknown placeholder `{{{0}}}`")]
    Unknown(String),
    #[error("`{{{0}}}` is missing from the command")]
    Missing(&'static str),
}

/// A program with its arguments, in which placeholders wait for paths.
///
/// Words are split as a POSIX shell splits them, with its quotes and backslashes, but nothing is
/// expanded: no variables, no `~`, no globs, no pipes. A placeholder is `{`, letters or `_`, `}`;
/// other braces are left alone. Placeholders are filled after the split, so that a path with spaces
/// stays one word.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TrainerCommand(Vec<String>);

impl TrainerCommand {
    /// Splits a command and checks its placeholders.
    pub fn parse(text: &str) -> Result<Self, CommandError> {
        let words = shlex::split(text).ok_or(CommandError::Quotes)?;
        if words.first().is_none_or(String::is_empty) {
            return Err(CommandError::Empty);
        }
        if is_torch(text) {
            let own = TORCH_COMMAND.split_whitespace().map(str::to_string);
            return Ok(Self(own.chain(words.into_iter().skip(1)).collect()));
        }
        let used: Vec<&str> = words.iter().flat_map(|word| placeholders(word)).collect();
        if let Some(name) = used.iter().find(|name| !PLACEHOLDERS.contains(name)) {
            return Err(CommandError::Unknown(name.to_string()));
        }
        match NEEDED.into_iter().find(|name| !used.contains(name)) {
            Some(name) => Err(CommandError::Missing(name)),
            None => Ok(Self(words)),
        }
    }

    /// Whether a word of the command asks for a placeholder.
    pub fn asks_for(&self, name: &str) -> bool {
        self.0.iter().any(|word| placeholders(word).contains(&name))
    }

    /// The words, with each placeholder replaced by `value`.
    pub fn fill(&self, value: impl Fn(&str) -> String) -> Vec<String> {
        self.0.iter().map(|word| filled(word, &value)).collect()
    }
}

/// In one pass, so that braces in a path are left as they are.
fn filled<'a>(word: &'a str, mut value: impl FnMut(&'a str) -> String) -> String {
    let (mut text, mut rest) = (String::new(), word);
    while let Some((before, name, after)) = next_placeholder(rest) {
        text += before;
        text += &value(name);
        rest = after;
    }
    text + rest
}

fn placeholders(word: &str) -> Vec<&str> {
    let mut names = Vec::new();
    filled(word, |name| {
        names.push(name);
        String::new()
    });
    names
}

/// The text before the next placeholder, its name, and the text behind it.
fn next_placeholder(text: &str) -> Option<(&str, &str, &str)> {
    let is_name = |s: &str| !s.is_empty() && s.chars().all(|c| c.is_alphabetic() || c == '_');
    text.match_indices('{').find_map(|(at, _)| {
        let (name, after) = text[at + 1..].split_once('}')?;
        is_name(name).then_some((&text[..at], name, after))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(command: &str) -> Vec<String> {
        TrainerCommand::parse(command).unwrap().fill(|name| format!("/a b/{{{name}}}"))
    }

    #[test]
    fn a_command_is_split_as_a_shell_would_and_paths_stay_one_word() {
        let command = r#"python3 'my train.py' --spec={spec} "{out}" a\ b "$HOME" '{"k": {}}' ''"#;
        let expected = [
            "python3",
            "my train.py",
            "--spec=/a b/{spec}",
            "/a b/{out}",
            "a b",
            "$HOME",
            r#"{"k": {}}"#,
            "",
        ];
        assert_eq!(words(command), expected);
        assert_eq!(words("x {spec}{out}{checkpoint}").len(), 2);
    }

    #[test]
    fn torch_stands_for_a_command_and_takes_options() {
        let words = words("torch --device cpu");
        assert_eq!(words[..3], ["/a b/{python}", "-m", "isoflop.torch"]);
        assert_eq!(words[words.len() - 3..], ["/a b/{init}", "--device", "cpu"]);
        assert!(is_torch(" torch") && !is_torch("torchrun x"));
    }

    #[test]
    fn commands_that_cannot_train_are_refused() {
        let error = |command: &str| TrainerCommand::parse(command).unwrap_err();
        assert_eq!(error("  "), CommandError::Empty);
        assert_eq!(error("'' {spec} {out}"), CommandError::Empty);
        assert_eq!(error("sh 'a {spec} {out}"), CommandError::Quotes);
        assert_eq!(error("sh {spec} {out} {seed}"), CommandError::Unknown("seed".into()));
        assert_eq!(error("sh {spec}"), CommandError::Missing("out"));
        assert_eq!(error("sh {out}").to_string(), "`{spec}` is missing from the command");
    }
}
