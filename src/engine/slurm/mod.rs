//! A sweep on a cluster, through Slurm's plain command line.
//!
//! The jobs of a plan become array tasks, each of which does a list of jobs as `isoflop run` would
//! on one machine. Files are the truth, Slurm is transport: what is done is what has a record.
//!
//! ```text
//! inputs (a task a tokenizer) --afterok--> train (arrays of packed runs) --afterany--> fit
//! ```

mod cluster;
mod command;
mod files;
mod packing;
mod session;
mod stages;
mod submission;
mod worker;

pub use command::SlurmError;
pub use session::Slurm;
