//! What an engine says of a sweep.

use serde_json::Value;

/// What an engine says of a sweep, beside the sweep's folder.
#[derive(Clone, Debug, PartialEq)]
pub struct EngineState {
    /// For `--json`.
    pub document: Value,
    /// For a person.
    pub text: String,
    /// Whether runs are left that a new submission would hand over.
    pub wants_more: bool,
}

/// What became of a wish to end, from the least to the worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cancelled {
    NothingRan,
    /// Everything ended within the time given to it.
    Ended,
    /// Something had to be killed; it goes on from its last checkpoint.
    Killed,
    StillAtWork,
}
