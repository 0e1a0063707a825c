//! What a finished run leaves behind: its record, and the table of all records.

pub mod atomic;
mod folder;
mod job_id;
pub mod mapped;
mod run_record;
pub mod table;

pub use folder::{Failure, JobState, ResultsFolder, RunStates, read_if_there};
pub use job_id::{JobId, JobKind};
pub use run_record::RunRecord;
