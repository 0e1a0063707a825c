//! From a plan to finished jobs: an order, a pool of slots, a process a job.

mod executor;
mod job;
mod pool;
pub mod presence;
pub mod probe;
mod progress;
mod signals;
mod state;
pub mod trainer;
mod waiting;
pub mod worker;

pub use executor::{Executor, JobEnd, JobReport, LocalProcesses, Runner};
pub use job::{Job, inputs, missing_jobs, run as job_of_run};
pub use pool::LocalPool;
pub use progress::{Display, left};
pub use signals::{Stop, stop_on_signals};
pub use state::{Counts, FailedJob, Running, SweepState, sweep_state};
