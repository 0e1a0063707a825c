//! [`Failure`]: why a job has no result, in a word, a sentence and the last lines of its log.

use serde::{Deserialize, Serialize};

/// What went wrong, in a word that scripts can tell apart.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum FailureKind {
    /// The loss is no number any more, or far above that of knowing nothing.
    Diverged,
    /// The data cannot be used as the sweep asks.
    BadData,
    /// Nothing more can be written: the disk, a quota or a limit on file sizes.
    DiskFull,
    /// The folder may not be written to.
    ReadOnly,
    /// A file is not what was written there, and could not be made again.
    Damaged,
    /// No progress for longer than `train.hang_s`.
    Hung,
    /// Somebody, or the system, ended the process.
    Killed,
    /// The process asked for more memory than there was.
    OutOfMemory,
    /// The process died of a fault of its own.
    Crashed,
    /// The program of a sweep's `trainer` failed.
    Trainer,
    /// Anything else.
    #[default]
    Other,
}

/// What follows from a failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It would end so again.
    Final,
    /// It may go well another time.
    MayPass,
    /// Every other job would end so too.
    StopsAll,
}

impl FailureKind {
    /// Whether trying again, or going on with other jobs, makes sense.
    pub fn verdict(self) -> Verdict {
        match self {
            Self::DiskFull | Self::ReadOnly => Verdict::StopsAll,
            Self::Hung | Self::Killed | Self::OutOfMemory | Self::Crashed => Verdict::MayPass,
            Self::Diverged | Self::BadData | Self::Damaged | Self::Trainer | Self::Other => {
                Verdict::Final
            }
        }
    }

    /// The word as it stands in `failure.json`.
    pub fn word(self) -> &'static str {
        match self {
            Self::Diverged => "diverged",
            Self::BadData => "bad-data",
            Self::DiskFull => "disk-full",
            Self::ReadOnly => "read-only",
            Self::Damaged => "damaged",
            Self::Hung => "hung",
            Self::Killed => "killed",
            Self::OutOfMemory => "out-of-memory",
            Self::Crashed => "crashed",
            Self::Trainer => "trainer",
            Self::Other => "other",
        }
    }

    /// The kind of a sentence that quotes an error of the system, whose number the standard library
    /// writes as `(os error 28)`; `None` where it quotes none that is told apart.
    ///
    /// That something may not be touched says that the folder is read-only only where something was
    /// to be written: data that may not be read is another matter.
    pub fn of_system_error(sentence: &str) -> Option<Self> {
        match os_error(sentence)? {
            // EFBIG, ENOSPC, EDQUOT.
            27 | 28 | 122 => Some(Self::DiskFull),
            // EROFS.
            30 => Some(Self::ReadOnly),
            // EPERM, EACCES.
            1 | 13 if sentence.contains(super::atomic::CANNOT_WRITE) => Some(Self::ReadOnly),
            // ENOMEM.
            12 => Some(Self::OutOfMemory),
            _ => None,
        }
    }

    /// What to do about it, where the sentence alone does not say.
    pub fn advice(self) -> Option<&'static str> {
        match self {
            Self::DiskFull => Some("free some space, or raise the quota or limit"),
            Self::ReadOnly => Some("make the folder writable, or name another with --out"),
            Self::OutOfMemory => Some("give it more memory, or fewer --jobs"),
            Self::Hung => Some("raise train.hang_s where it only was slow"),
            _ => None,
        }
    }
}

/// The number in the last `(os error N)` of a sentence.
pub fn os_error(sentence: &str) -> Option<i32> {
    let (_, rest) = sentence.rsplit_once("(os error ")?;
    rest.split_once(')')?.0.parse().ok()
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

    /// A failure told by an error of the system; otherwise of the given kind.
    pub fn of_sentence(sentence: String, otherwise: FailureKind) -> Self {
        Self::new(FailureKind::of_system_error(&sentence).unwrap_or(otherwise), sentence)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_system_refused_is_told_from_its_number() {
        let kind = |code: i32, words: &str| {
            let error = std::io::Error::from_raw_os_error(code);
            FailureKind::of_system_error(&format!("{words}: {error}"))
        };
        assert_eq!(kind(28, "cannot write a/b"), Some(FailureKind::DiskFull));
        assert_eq!(kind(27, "cannot write a/b"), Some(FailureKind::DiskFull));
        assert_eq!(kind(30, "making a/.lock"), Some(FailureKind::ReadOnly));
        assert_eq!(kind(13, "cannot write a/b"), Some(FailureKind::ReadOnly));
        assert_eq!(kind(13, "cannot read texts/a.txt"), None);
        assert_eq!(kind(2, "cannot read a"), None);
        assert_eq!(FailureKind::of_system_error("the loss is NaN"), None);
    }

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
