//! From a sweep to priced runs: `Sweep → GridCell → PricedCell → RunSpec`, gathered in [`Plan`].
//!
//! # Example
//!
//! ```
//! use isoflop::data::DataFacts;
//! use isoflop::plan::Plan;
//! use isoflop::sweep;
//!
//! let text = "name: first\ngrid: {models: scamo, vocab: [256], budgets: [1e18]}\n";
//! let sweep = sweep::parse("first.yaml", text, &[])?;
//! let plan = Plan::new(&sweep, DataFacts::absent("no motion yet".to_string()));
//! let run = &plan.runs[0];
//! let spent = 6.0 * (run.params.nonvocab + run.params.vocab) as f64 * run.spec.tokens() as f64;
//! println!("{} runs; the first spends {spent:.2e} of 1e18 FLOPs by the rule 6ND", plan.runs.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod assemble;
mod cells;
mod evaluator_job;
mod exact;
mod expand;
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

pub use assemble::{MOST_USEFUL_EPOCHS, Plan, demand};
pub use evaluator_job::EvaluatorJob;
pub use expand::NO_TOKENIZER;
pub use memory::{
    bytes_on_card, evaluator_peak_bytes, text_peak_bytes, tokenizer_peak_bytes, tokens_peak_bytes,
};
pub use planned_run::PlannedRun;
pub use priced_cell::Dropped;
pub use run_spec::{RunSpec, TRAINING_REVISION, TokenizerJob, TrainerProgram};
pub use score_job::ScoreJob;
pub use steps::learning_rate;
pub use text_job::TextJob;
pub use trunk::Trunk;
pub use vocabulary::Renamed;
