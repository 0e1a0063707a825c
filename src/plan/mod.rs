//! From a sweep to priced runs: `Sweep → GridCell → PricedCell → RunSpec`, gathered in [`Plan`].

mod assemble;
mod cells;
mod evaluator_job;
mod memory;
mod planned_run;
mod price;
mod priced_cell;
mod remarks;
mod run_spec;
mod score_job;
mod steps;
mod text_job;
mod trunk;
mod vocabulary;

pub use assemble::{MOST_USEFUL_EPOCHS, NO_TOKENIZER, Plan, demand};
pub use evaluator_job::EvaluatorJob;
pub use memory::{evaluator_peak_bytes, text_peak_bytes, tokenizer_peak_bytes, tokens_peak_bytes};
pub use planned_run::PlannedRun;
pub use priced_cell::Dropped;
pub use run_spec::{RunSpec, TRAINING_REVISION, TokenizerJob, TrainerProgram};
pub use score_job::ScoreJob;
pub use steps::learning_rate;
pub use text_job::TextJob;
pub use trunk::Trunk;
pub use vocabulary::Renamed;
