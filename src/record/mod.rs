//! What a finished run leaves behind: its record, and the table of all records.

mod run_record;
pub mod table;

pub use run_record::{RunRecord, flops_per_second};
