//! What a finished run leaves behind: its record, and the table of all records.
//!
//! [`facts`] declares every fact once. Records and the table follow from the declaration: a new fact
//! is a line there, and a value where records are made.

mod cell;
mod declare;
pub mod facts;
mod json;
mod metrics;
mod quality;
mod run_record;
mod score_row;
mod scored_run;
pub mod table;
#[cfg(test)]
mod tests;

pub use cell::{CellKind, CellValue, FactColumn};
pub use facts::{Measured, Planned};
pub use metrics::Metrics;
pub use quality::{Quality, write_scores};
pub use run_record::{FORMAT, Lacking, RunRecord, flops_per_second};
pub use score_row::{ScoreRow, write_published};
pub use scored_run::{ScoredRun, read_scores};
