//! A sweep's results as one page that opens without a network: `report.html`.
//!
//! [`ReportInput`] is all that the page shows; a file a section makes its markup of that. The script
//! only moves, sorts and filters what is there: every number is written here.
//!
//! # Example
//!
//! ```
//! use std::path::Path;
//!
//! use isoflop::record::table;
//! use isoflop::report::{ReportInput, Study, page};
//!
//! let records = table::read(Path::new("results/cmu-motion"))?;
//! let study = Study {
//!     generator: None,
//!     loss_name: None,
//!     verdict: "No laws yet.",
//!     laws: None,
//!     predictions: &[],
//!     records: &records,
//!     figures: &[],
//! };
//! let html = page(&ReportInput {
//!     name: "cmu-motion",
//!     studies: &[study],
//!     samples: &[],
//!     tokenizers: &[],
//!     figures: &[],
//!     sweep: "name: cmu-motion",
//!     dropped: &[],
//! });
//! assert!(html.starts_with("<!DOCTYPE html>") && !html.contains("src=\"http"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod about;
mod beside;
mod chart;
mod curves;
mod input;
mod laws;
mod page;
mod prediction;
mod runs;
mod samples;
mod scaling;
mod table;
mod tokenizers;
mod words;

pub use input::{Figure, ReportInput, Sample, Study};
pub use page::page;
