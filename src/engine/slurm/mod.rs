//! Runs a sweep on a cluster, through Slurm's plain command line.
//!
//! The jobs of a plan become array tasks; each runs a list of jobs as `isoflop run` would on one machine. The state is
//! read from files, never from Slurm: a job is done if it has a record.
//!
//! ```text
//! inputs (one task per tokenizer) --afterok--> train (arrays of packed runs) --afterany--> fit
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
