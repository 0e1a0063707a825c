//! [`JobId`]: names one thing to do by what it makes.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::kind::JobKind;

/// One thing to do. Its id is the hash of all that its result depends on; jobs of different kinds
/// may have the same, as a tokenizer and its codes do.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct JobId {
    pub kind: JobKind,
    pub id: String,
}

impl JobId {
    /// The job of a kind that makes what `id` names.
    pub fn new(kind: JobKind, id: impl Into<String>) -> Self {
        Self { kind, id: id.into() }
    }

    /// The run of an id.
    pub fn run(id: impl Into<String>) -> Self {
        Self::new(JobKind::Run, id)
    }
}

impl fmt::Display for JobId {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} {}", self.kind.word(), self.id)
    }
}
