//! What can go wrong between us and Slurm.

use std::io;

use crate::files::FileError;

/// Why a command of Slurm gave no answer, or not the one that was wanted.
#[derive(Debug, thiserror::Error)]
pub enum SlurmError {
    #[error("`{program}` could not be started ({error}); is this a machine with Slurm on it?")]
    NotThere { program: String, error: io::Error },
    #[error("`{program}` gave no answer within {seconds} s")]
    Silent { program: String, seconds: u64 },
    #[error("`{program}` said: {said}")]
    Refused { program: String, said: String, reason: Refusal },
    #[error("`sbatch` answered `{0}`, in which there is no job's number")]
    NoNumber(String),
    #[error("files of the submission: {0}")]
    Files(#[from] FileError),
    #[error("files of the submission: {0}")]
    Io(#[from] io::Error),
}

/// Why a command of Slurm refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// Too many jobs of this user are in the queue.
    SubmitLimit,
    /// The controller is busy, restarting or out of reach: the same call may do in a moment.
    Busy,
    /// Something that a person has to mend.
    Final,
}

/// What Slurm's commands say of each refusal that is not final. They have one exit code for all, so
/// that their words are all there is to read; they are read here and nowhere else.
const WORDS: [(Refusal, &[&str]); 2] = [
    (
        Refusal::SubmitLimit,
        &[
            "AssocMaxSubmitJobLimit",
            "QOSMaxSubmitJobPerUserLimit",
            "MaxSubmitJobs",
            "Job violates accounting/QOS policy",
        ],
    ),
    (
        Refusal::Busy,
        &[
            "Unable to contact slurm controller",
            "Socket timed out",
            "temporarily unable",
            "Resource temporarily unavailable",
            "Connection refused",
            "Zero Bytes were transmitted",
        ],
    ),
];

impl SlurmError {
    /// What a program said that failed.
    pub fn refused(program: &str, said: String) -> Self {
        let is_said = |words: &&[&str]| words.iter().any(|words| said.contains(words));
        let known = WORDS.iter().find(|(_, words)| is_said(words));
        let reason = known.map_or(Refusal::Final, |(reason, _)| *reason);
        Self::Refused { program: program.to_string(), said, reason }
    }

    /// Whether Slurm holds back because too many jobs of this user are in its queue.
    pub fn is_submit_limit(&self) -> bool {
        matches!(self, Self::Refused { reason: Refusal::SubmitLimit, .. })
    }

    /// Whether the same call may do in a moment.
    pub fn may_pass(&self) -> bool {
        matches!(self, Self::Silent { .. } | Self::Refused { reason: Refusal::Busy, .. })
    }
}
