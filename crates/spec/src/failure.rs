//! [`Failure`]: why a job has no result, in a word, a sentence and the last lines of its log.
//!
//! # Example
//!
//! ```
//! use isoflop_spec::failure::FailureKind;
//!
//! // What a person can do about it, if known.
//! assert!(FailureKind::DiskFull.advice().is_some());
//! ```

use std::io;

use serde::{Deserialize, Serialize};

/// The kind of a failure, as a word for scripts.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum FailureKind {
    /// The loss is not a number, or far above that of a uniform guess.
    Diverged,
    /// The data cannot be used as the sweep asks.
    BadData,
    /// Nothing more can be written: the disk, a quota or a limit on file sizes.
    DiskFull,
    /// The folder may not be written to.
    ReadOnly,
    /// The sweep's folder was removed or renamed.
    FolderGone,
    /// A file is damaged and could not be remade.
    Damaged,
    /// Another program changed files of the sweep while a job used them.
    FilesChanged,
    /// No progress for longer than `train.hang_s`.
    Hung,
    /// Somebody, or the system, ended the process.
    Killed,
    /// The process asked for more memory than there was.
    OutOfMemory,
    /// The process crashed.
    Crashed,
    /// The program of a sweep's `trainer` failed.
    Trainer,
    /// Anything else.
    #[default]
    Other,
}

/// The consequence of a failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Consequence {
    /// A retry would fail in the same way.
    Final,
    /// A retry may succeed.
    MayPass,
    /// Every other job would end so too.
    StopsAll,
}

impl FailureKind {
    /// The word in files, the consequence, and advice if the message alone has none.
    const fn facts(self) -> (&'static str, Consequence, Option<&'static str>) {
        use Consequence::{Final, MayPass, StopsAll};
        match self {
            Self::Diverged => ("diverged", Final, None),
            Self::BadData => ("bad-data", Final, None),
            Self::DiskFull => {
                ("disk-full", StopsAll, Some("free some space, or raise the quota or limit"))
            }
            Self::ReadOnly => {
                let advice = "make the folder writable, or name another with --out";
                ("read-only", StopsAll, Some(advice))
            }
            Self::FolderGone => {
                ("folder-gone", StopsAll, Some("give the folder its place and name again"))
            }
            Self::Damaged => ("damaged", Final, None),
            Self::FilesChanged => {
                ("files-changed", MayPass, Some("let no other program write into the folder"))
            }
            Self::Hung => ("hung", MayPass, Some("raise train.hang_s where it only was slow")),
            Self::Killed => ("killed", MayPass, None),
            Self::OutOfMemory => {
                ("out-of-memory", MayPass, Some("give it more memory, or fewer --jobs"))
            }
            Self::Crashed => ("crashed", MayPass, None),
            Self::Trainer => ("trainer", Final, None),
            Self::Other => ("other", Final, None),
        }
    }

    /// Whether trying again, or going on with other jobs, makes sense.
    pub fn consequence(self) -> Consequence {
        self.facts().1
    }

    /// The word in `failure.json`.
    pub fn word(self) -> &'static str {
        self.facts().0
    }

    /// Advice, if the message alone has none.
    pub fn advice(self) -> Option<&'static str> {
        self.facts().2
    }

    /// The kind of a system error; `None` for other errors.
    pub fn of_io(error: &io::Error) -> Option<Self> {
        match error.raw_os_error()? {
            // EFBIG, ENOSPC, EDQUOT.
            27 | 28 | 122 => Some(Self::DiskFull),
            // EROFS.
            30 => Some(Self::ReadOnly),
            // ENOMEM.
            12 => Some(Self::OutOfMemory),
            _ => None,
        }
    }
}

/// Why a job has no result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Failure {
    /// [`FailureKind::Other`] in files of older builds.
    #[serde(default)]
    pub kind: FailureKind,
    /// One sentence.
    pub reason: String,
    /// The last lines that the worker wrote.
    pub last_lines: Vec<String>,
}

impl Failure {
    /// A failure whose log is still to be read.
    pub fn new(kind: FailureKind, reason: impl Into<String>) -> Self {
        Self { kind, reason: reason.into(), last_lines: Vec::new() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failures_of_older_builds_are_read() {
        let text = r#"{"reason": "lower train.lr", "last_lines": []}"#;
        let failure: Failure = serde_json::from_str(text).unwrap();
        assert_eq!(failure.kind, FailureKind::Other);
    }

    #[test]
    fn words_are_those_of_the_file() {
        let kinds = [FailureKind::OutOfMemory, FailureKind::BadData, FailureKind::Diverged];
        for kind in kinds {
            assert_eq!(serde_json::to_value(kind).unwrap(), kind.word());
        }
    }
}
