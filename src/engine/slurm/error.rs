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
    Refused { program: String, said: String },
    #[error("`sbatch` answered `{0}`, in which there is no job's number")]
    NoNumber(String),
    #[error("files of the submission: {0}")]
    Files(#[from] FileError),
    #[error("files of the submission: {0}")]
    Io(#[from] io::Error),
}

impl SlurmError {
    /// Whether Slurm holds back because too many jobs of this user are in its queue.
    pub fn is_submit_limit(&self) -> bool {
        const LIMITS: [&str; 4] = [
            "AssocMaxSubmitJobLimit",
            "QOSMaxSubmitJobPerUserLimit",
            "MaxSubmitJobs",
            "Job violates accounting/QOS policy",
        ];
        matches!(self, Self::Refused { said, .. } if LIMITS.iter().any(|limit| said.contains(limit)))
    }

    /// Whether the same call may do in a moment: the controller is busy, restarting or out of reach.
    pub fn may_pass(&self) -> bool {
        const PASSING: [&str; 6] = [
            "Unable to contact slurm controller",
            "Socket timed out",
            "temporarily unable",
            "Resource temporarily unavailable",
            "Connection refused",
            "Zero Bytes were transmitted",
        ];
        match self {
            Self::Silent { .. } => true,
            Self::Refused { said, .. } => PASSING.iter().any(|words| said.contains(words)),
            _ => false,
        }
    }
}
