//! A sweep's results as one page that opens without a network: `report.html`.
//!
//! [`ReportInput`] is all that the page shows; a file a section makes its markup of that. The script
//! only moves, sorts and filters what is there: every number is written here.

mod about;
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

pub use input::{Figure, ReportInput, Sample};
pub use page::page;
