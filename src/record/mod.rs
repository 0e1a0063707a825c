//! What a finished run leaves behind: its record, and the table of all records.

pub mod atomic;
pub mod damaged;
mod failure;
mod folder;
mod job_id;
pub mod mapped;
mod run_record;
pub mod table;

pub use failure::{Failure, FailureKind, Verdict, os_error};
pub use folder::{JobState, ResultsFolder, RunStates, read_if_there};
pub use job_id::{JobId, JobKind};
pub use run_record::{RunRecord, flops_per_second};
