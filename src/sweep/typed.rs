//! Converts a YAML value to its type, and names every wrong entry in terms of YAML.

use super::problem::{Problem, nearest};
use super::sections::{SlurmSection, Sweep};
use super::variants::remove;
use crate::units::ranges::outside;
use schemars::schema_for;
use serde::de::DeserializeOwned;
use serde_json::Value as Schema;
use serde_yaml::Value;
use std::sync::LazyLock;

/// Entries that are told at once: each is looked for in the whole file again.
const MOST_TOLD: usize = 20;

/// Deserialises; each entry that fails is noted and taken out, until the rest is right or stuck.
pub fn typed<T: DeserializeOwned>(
    mut value: Value,
    removed: &mut RemovedEntries,
    problems: &mut Vec<Problem>,
) -> Option<T> {
    loop {
        let error = match serde_path_to_error::deserialize::<_, T>(value.clone()) {
            Ok(typed) => return Some(typed),
            Err(error) => error,
        };
        let path = error.path().to_string();
        let path = if path == "." { String::new() } else { path };
        let message = error.inner().to_string();
        let in_the_file = removed.in_the_file(&path);
        let missed = missing_field(&in_the_file, &message);
        if missed.is_none_or(|field| !removed.holds(&field)) {
            problems.push(explain(&in_the_file, &message));
        }
        if problems.len() >= MOST_TOLD {
            problems.push(Problem::value("", "there may be more: mend these first"));
            return None;
        }
        if path.is_empty() || !remove(&mut value, &path) {
            return None;
        }
        removed.note(in_the_file);
    }
}

/// The path of the missing field in `message`; a removed field is no further problem.
fn missing_field(path: &str, message: &str) -> Option<String> {
    let name = message.strip_prefix("missing field `")?.split('`').next()?;
    Some(if path.is_empty() { name.to_string() } else { format!("{path}.{name}") })
}

/// Turns serde's words into ours, with the nearest valid name for an unknown one.
fn explain(path: &str, message: &str) -> Problem {
    let names: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    let unknown = message.starts_with("unknown field") || message.starts_with("unknown variant");
    let problem = Problem::value(path, plain(message.split(" at line ").next().unwrap_or(message)));
    match names.split_first() {
        Some((wrong, valid)) if unknown => Problem {
            message: format!("unknown name `{wrong}`"),
            help: Some(nearest(wrong, valid)),
            at_key: message.starts_with("unknown field"),
            ..problem
        },
        _ => problem,
    }
}

/// serde's names of YAML values, and plain ones: as found, and as expected.
const WORDS: [(&str, &str); 17] = [
    ("floating point ", ""),
    ("integer ", ""),
    ("boolean ", ""),
    ("string \"", "\""),
    ("unit value", "nothing"),
    ("sequence", "a list"),
    ("map", "a section"),
    ("a sequence", "a list"),
    ("a map", "a section"),
    ("a boolean", "true or false"),
    ("a string", "text"),
    ("string or map", "a word or a section"),
    ("usize", "a whole number"),
    ("u64", "a whole number"),
    ("u32", "a whole number"),
    ("f64", "a number"),
    ("path string", "a path"),
];

/// `invalid type: sequence, expected a string` as `expected text, found a list`; all else as it is.
fn plain(message: &str) -> String {
    let types =
        message.strip_prefix("invalid type: ").and_then(|rest| rest.split_once(", expected "));
    let Some((found, expected)) = types else { return message.to_string() };
    let expected = match expected.split_once(' ') {
        Some(("struct" | "internally", _)) => "a section, `key: value`".to_string(),
        _ => in_words(expected),
    };
    format!("expected {expected}, found {}", in_words(found))
}

fn in_words(what: &str) -> String {
    let whole = WORDS.iter().find(|(theirs, _)| *theirs == what);
    let start =
        WORDS.iter().find(|(theirs, _)| theirs.ends_with([' ', '"']) && what.starts_with(theirs));
    match (whole, start) {
        (Some((_, ours)), _) => (*ours).to_string(),
        (None, Some((theirs, ours))) => format!("{ours}{}", &what[theirs.len()..]),
        (None, None) => what.to_string(),
    }
}

/// Paths of removed entries, as in the file.
///
/// Removing an item of a list shifts the items after it, so paths of the rest must be mapped back to the file.
#[derive(Default)]
pub struct RemovedEntries(Vec<String>);

impl RemovedEntries {
    /// Notes an entry by its path in the file.
    pub fn note(&mut self, path: String) {
        self.0.push(path);
    }

    /// Whether the entry was removed, so that its absence is no further problem.
    pub fn holds(&self, path: &str) -> bool {
        self.0.iter().any(|taken| taken == path)
    }

    /// Whether the list at `path` has lost items, so that its length says nothing.
    pub fn shortened(&self, path: &str) -> bool {
        !self.items(path).is_empty()
    }

    /// The path in the file of the entry now at `path`.
    pub fn in_the_file(&self, path: &str) -> String {
        let (mut found, mut rest) = (String::new(), path);
        while let Some((before, after)) = rest.split_once('[') {
            found.push_str(before);
            let (index, behind) = after.split_once(']').unwrap_or((after, ""));
            let index = index.parse().map_or(0, |index| self.index(&found, index));
            found.push_str(&format!("[{index}]"));
            rest = behind;
        }
        found + rest
    }

    fn index(&self, list: &str, index: usize) -> usize {
        self.items(list).into_iter().fold(index, |index, gone| index + usize::from(gone <= index))
    }

    /// Indices of the items of a list that are gone, ascending.
    fn items(&self, list: &str) -> Vec<usize> {
        let index = |path: &String| {
            path.strip_prefix(list)?.strip_prefix('[')?.strip_suffix(']')?.parse().ok()
        };
        let mut items: Vec<usize> = self.0.iter().filter_map(index).collect();
        items.sort_unstable();
        items
    }
}

// Numbers of a sweep file or a profile outside the ranges at their fields.

static SWEEP: LazyLock<Schema> = LazyLock::new(|| schema_for!(Sweep).to_value());
static PROFILE: LazyLock<Schema> = LazyLock::new(|| schema_for!(SlurmSection).to_value());

/// Problems of a sweep file, or of a part of one, as written.
pub fn outside_of_sweep(keys: &Value) -> Vec<Problem> {
    problems(&SWEEP, keys)
}

/// Problems of a profile.
pub fn outside_of_profile(keys: &Value) -> Vec<Problem> {
    problems(&PROFILE, keys)
}

fn problems(schema: &Schema, keys: &Value) -> Vec<Problem> {
    outside(schema, keys).into_iter().map(|(path, told)| Problem::value(path, told)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_are_told_as_people_write_them() {
        let cases = [
            (
                "invalid type: floating point `0.0003`, expected struct X",
                "expected a section, `key: value`, found `0.0003`",
            ),
            ("invalid type: sequence, expected a string", "expected text, found a list"),
            (
                "invalid type: string \"many\", expected a boolean",
                "expected true or false, found \"many\"",
            ),
            ("invalid type: unit value, expected a sequence", "expected a list, found nothing"),
            (
                "invalid type: map, expected a list of models",
                "expected a list of models, found a section",
            ),
            ("expected a number, found `abc`", "expected a number, found `abc`"),
        ];
        for (theirs, ours) in cases {
            assert_eq!(plain(theirs), ours);
        }
    }

    #[test]
    fn paths_lead_back_past_every_item_that_is_gone() {
        let mut removed = RemovedEntries::default();
        for path in
            ["grid.models[3]", "grid.models[0]", "grid.models[1]", "grid.vocab[1].levels[0]"]
        {
            removed.note(path.to_string());
        }
        for (now, file) in [
            ("grid.models[0].n_head", "grid.models[2].n_head"),
            ("grid.models[1]", "grid.models[4]"),
            ("grid.vocab[1].levels[0]", "grid.vocab[1].levels[1]"),
            ("grid.vocab[2].levels[0]", "grid.vocab[2].levels[0]"),
            ("train.lr", "train.lr"),
        ] {
            assert_eq!(removed.in_the_file(now), file);
        }
        assert!(removed.shortened("grid.models") && !removed.shortened("grid.vocab"));
    }
}
