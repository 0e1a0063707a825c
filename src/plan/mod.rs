//! From a sweep to priced runs: `Sweep → Cell → PricedCell → RunSpec`, gathered in [`Plan`].

mod assemble;
mod cells;
mod memory;
mod price;
mod run_spec;
mod steps;
mod trunk;

pub use assemble::{MOST_USEFUL_EPOCHS, NO_TOKENIZER, Plan, PlannedRun, TextJob, demand};
pub use memory::{text_peak_bytes, tokenizer_peak_bytes, tokens_peak_bytes};
pub use price::Dropped;
pub use run_spec::{RunSpec, TRAINING_REVISION, TokenizerJob};
pub use trunk::Trunk;
