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

impl KeyProblem {
    /// The checks that do not hold.
    pub fn failed(
        checks: impl IntoIterator<Item = (bool, &'static str, &'static str, Option<&'static str>)>,
    ) -> Vec<Self> {
        let failed = checks.into_iter().filter(|(holds, ..)| !holds);
        failed.map(|(_, field, problem, help)| Self { field, problem, help }).collect()
    }
}

/// The checks that do not hold, of such that need no help.
pub(super) fn failed<const N: usize>(
    checks: [(bool, &'static str, &'static str); N],
) -> Vec<KeyProblem> {
    KeyProblem::failed(checks.map(|(holds, field, problem)| (holds, field, problem, None)))
}

/// An error unless a condition holds.
pub(super) fn require(holds: bool, field: &'static str, problem: &str) -> Result<(), SpecError> {
    if holds { Ok(()) } else { Err(SpecError { field, problem: problem.to_string() }) }
}

/// The first check that does not hold.
pub(super) fn require_all<const N: usize>(
    checks: [(bool, &'static str, &str); N],
) -> Result<(), SpecError> {
    checks.into_iter().try_for_each(|(holds, field, problem)| require(holds, field, problem))
}
