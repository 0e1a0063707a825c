//! A sweep on a cluster, through Slurm's plain command line.
//!
//! The jobs of a plan become array tasks, each of which does a list of jobs as `isoflop run` would
//! on one machine. Files are the truth, Slurm is transport: what is done is what has a record.
//!
//! ```text
//! inputs (a task a tokenizer) --afterok--> train (arrays of packed runs) --afterany--> fit
//! ```

pub mod cancel;
mod check;
mod chunks;
mod command;
mod error;
mod estimate;
mod files;
mod guard;
mod ledger;
mod queue;
mod reasons;
mod requeue;
mod script;
mod settings;
mod signals;
mod stages;
mod submission;
mod submit;
mod walltime;
pub mod worker;

pub use check::{Verdict, check};
pub use command::{Answer, QUERY, Shell, System, site_defaults};
pub use error::SlurmError;
pub use estimate::Estimates;
pub use files::{ChunkFile, Generation, SlurmFolder, Timed};
pub use ledger::{Entry, Ledger};
pub use queue::{Queue, Task, TaskState};
pub use reasons::{Outlook, outlook};
pub use settings::Settings;
pub use stages::{After, Array, Layout, arrays};
pub use submission::{Step, Submission, Written};
pub use submit::{Submitted, keep_program, submit};
