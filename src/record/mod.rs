//! What a finished run leaves behind: its record, and the table of all records.
//!
//! [`facts`] declares every fact once. Records and the table follow from the declaration: a new fact
//! is a line there, and a value where records are made.
//!
//! # Example
//!
//! ```
//! use std::path::Path;
//!
//! use isoflop::record::table;
//!
//! let runs = table::read(Path::new("results/cmu-motion"))?;
//! let best = runs.iter().filter_map(|run| run.loss_normalised().ok()).fold(f64::INFINITY, f64::min);
//! println!("{} runs, the best L_u {best:.3} nats", runs.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod cell;
mod declare;
pub mod facts;
mod json;
mod metrics;
mod quality;
mod run_record;
mod score_row;
mod scored_run;
mod sliced;
pub mod table;
#[cfg(test)]
mod tests;
mod tuned;

pub use cell::{CellKind, FactColumn};
pub use facts::{Measured, Planned, block_metric};
pub use metrics::Metrics;
pub use quality::{Quality, write_scores};
pub use run_record::{FORMAT, Lacking, RunRecord, flops_per_second, of_largest_share};
pub use score_row::{ScoreRow, write_published};
pub use scored_run::{ScoredRun, read_scores};
pub use sliced::sliced;
pub use tuned::Tuned;
