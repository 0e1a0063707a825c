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
mod memory;
mod planned;
mod price;
mod trunk;

pub use assemble::{MOST_USEFUL_EPOCHS, NO_TOKENIZER, Plan, TextJob, demand};
pub use cells::Renamed;
pub use memory::{
    bytes_on_card, evaluator_peak_bytes, text_peak_bytes, tokenizer_peak_bytes, tokens_peak_bytes,
};
pub use planned::{EvaluatorJob, PlannedRun, ScoreJob};

pub use trunk::{Dropped, Trunk, learning_rate};
