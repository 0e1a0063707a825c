//! [`SpecError`]: a value of a spec that will not do.

/// A field of a description has a value that no training can use.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("tokenizer.{field}: {problem}")]
pub struct SpecError {
    pub field: &'static str,
    pub problem: String,
}

/// A key of a section that will not do, and how to mend it; an empty field is the section itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KeyProblem {
    pub field: &'static str,
    pub problem: &'static str,
    pub help: Option<&'static str>,
}

/// An error unless a condition holds.
pub(super) fn require(holds: bool, field: &'static str, problem: &str) -> Result<(), SpecError> {
    if holds { Ok(()) } else { Err(SpecError { field, problem: problem.to_string() }) }
}
