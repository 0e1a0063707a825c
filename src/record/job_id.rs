//! [`JobId`]: names one thing to do by what it makes.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// What a job makes. Each kind needs what stands before it, and none what stands after.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JobKind {
    /// The embedded captions of a data set.
    Text,
    /// A trained tokenizer and its metrics.
    Tokenizer,
    /// The codes that a tokenizer gives a data set.
    Tokens,
    /// A model trained up to a point where runs branch off.
    Trunk,
    /// A finished run and its record.
    Run,
}

impl JobKind {
    /// All kinds, in the order in which they are needed.
    pub const ALL: [Self; 5] = [Self::Text, Self::Tokenizer, Self::Tokens, Self::Trunk, Self::Run];

    /// The word on a worker's command line.
    pub fn word(self) -> &'static str {
        match self {
            Self::Text => "text",
            Self::Tokenizer => "tokenizer",
            Self::Tokens => "tokens",
            Self::Trunk => "trunk",
            Self::Run => "run",
        }
    }
}

impl FromStr for JobKind {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|kind| kind.word() == word);
        found.ok_or_else(|| format!("no kind of job is named `{word}`"))
    }
}

/// One thing to do. Its id is the hash of all that its result depends on; a tokenizer and its codes
/// have the same.
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
