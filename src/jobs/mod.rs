//! What there is to do for a sweep: a file a kind of job.
//!
//! A [`JobKind`] says what it makes, where, from what and at what cost; [`worker::work`] does it. [`JobKind::ALL`]
//! lists them.
//!
//! # Example
//!
//! ```
//! use isoflop::data::DataFacts;
//! use isoflop::jobs::all_jobs;
//! use isoflop::plan::Plan;
//! use isoflop::sweep;
//!
//! let text = "name: first\ngrid: {models: scamo, vocab: [256], budgets: [1e18]}\n";
//! let sweep = sweep::parse("first.yaml", text, &[])?;
//! let plan = Plan::new(&sweep, DataFacts::absent("no motion yet".to_string()));
//! // Captions, a tokenizer and its codes come before the runs.
//! assert!(all_jobs(&plan).count() > plan.runs.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod adopt;
mod assignment;
mod evaluator;
mod exit;
mod folder;
pub mod gpu;
mod graph;
pub mod history;
mod id;
mod job;
mod kind;
mod mend;
pub mod presence;
pub mod probe;
pub mod program;
mod record;
mod run;
mod score;
mod spec_file;
pub mod speed;
mod state;
mod text;
mod tokenizer;
mod tokens;
mod trained;
mod trained_tokenizer;
mod training;
mod trunk;
mod trusted_evaluator;
pub mod worker;

pub use adopt::adopt;
pub use assignment::{Assignment, Outcome, frozen_sweep};
pub use folder::{JobState, ResultsFolder, RunStates};
pub use graph::{all_jobs, inputs, missing_jobs, with_needs};
pub use id::JobId;
pub use job::Job;
pub use kind::JobKind;
pub use score::{RunScores, ScoredPhysics, Scoring};
pub use spec_file::write_specs;
pub use state::{Counts, FailedJob, Running, SweepState, sweep_state, time_left};
pub use trained::{MadeMotion, TrainedRun};
pub use trained_tokenizer::TrainedTokenizer;
pub use trusted_evaluator::TrustedEvaluator;
