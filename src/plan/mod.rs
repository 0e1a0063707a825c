//! From a sweep to priced runs: `Sweep → GridCell → PricedCell → RunSpec`, gathered in [`Plan`].

mod assemble;
mod cells;
mod memory;
mod planned_run;
mod price;
mod priced_cell;
mod remarks;
mod run_spec;
mod steps;
mod text_job;
mod trunk;

pub use assemble::{MOST_USEFUL_EPOCHS, NO_TOKENIZER, Plan, demand};
pub use memory::{text_peak_bytes, tokenizer_peak_bytes, tokens_peak_bytes};
pub use planned_run::PlannedRun;
pub use priced_cell::Dropped;
pub use run_spec::{RunSpec, TRAINING_REVISION, TokenizerJob};
pub use steps::learning_rate;
pub use text_job::TextJob;
pub use trunk::Trunk;
