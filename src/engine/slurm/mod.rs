//! A sweep on a cluster, through Slurm's plain command line.
//!
//! The jobs of a plan become array tasks, each of which does a list of jobs as `isoflop run` would
//! on one machine. Files are the truth, Slurm is transport: what is done is what has a record.
//!
//! ```text
//! inputs (a task a tokenizer) --afterok--> train (arrays of packed runs) --afterany--> fit
//! ```

mod cancel;
mod check;
mod chunks;
mod cluster;
mod command;
mod error;
mod estimate;
mod files;
mod guard;
mod ledger;
mod packing;
mod preview;
mod queue;
mod reasons;
mod requeue;
mod script;
mod session;
mod settings;
mod signals;
mod stages;
mod status;
mod submission;
mod submit;
mod walltime;
mod worker;

pub use error::SlurmError;
pub use session::Slurm;
