//! A file of YAML keys, as text and as a mapping.

use std::path::Path;

use serde_yaml::{Mapping, Value};

use super::bounded;
use super::problem::{Problem, SweepErrors};
use super::source::Source;

/// What a sweep file is, for an error.
pub const SWEEP_FILE: &str = "a sweep file is a mapping with at least `name` and `grid`";

/// A file as it stands.
///
/// # Errors
/// It cannot be read.
pub fn source_of(path: &Path) -> Result<Source, SweepErrors> {
    let file = path.display().to_string();
    match crate::files::read_text(path) {
        Ok(text) => Ok(Source::new(file, text)),
        Err(error) => {
            let problem = Problem::value("", format!("cannot read {file}: {error}"));
            Err(SweepErrors::of(problem, Source::new(file, "")))
        }
    }
}

/// The mapping that a text holds; `otherwise` says what it should hold.
///
/// # Errors
/// It is not YAML, or no mapping.
pub fn mapping(text: &str, otherwise: &str) -> Result<Mapping, Problem> {
    let value = bounded::value(text).map_err(|error| Problem {
        byte: error.location().map(|location| location.index()),
        ..Problem::value("", format!("not valid YAML: {error}"))
    })?;
    match value {
        Value::Mapping(keys) => Ok(keys),
        _ => Err(Problem::value("", otherwise)),
    }
}
