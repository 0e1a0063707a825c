//! From a sweep to priced runs: `Sweep → Cell → PricedCell → RunSpec`, gathered in [`Plan`].

mod assemble;
pub mod flops;
mod grid;
mod memory;
mod price;
mod run_spec;
mod shape;
mod steps;
mod trunk;

pub use assemble::{MOST_USEFUL_EPOCHS, NO_TOKENIZER, Plan, PlannedRun, TextJob, longest_run};
pub use memory::{peak_bytes, text_peak_bytes, tokenizer_peak_bytes, tokens_peak_bytes};
pub use price::{Dropped, FlopsPerToken};
pub use run_spec::{RunSpec, TRAINING_REVISION, TokenizerJob, changed_fields, content_id};
pub use shape::{ModelShape, ParamCounts, models};
pub use trunk::Trunk;
