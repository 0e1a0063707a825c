//! From a plan to finished jobs: an order, a pool of slots, a process a job.

mod executor;
mod job;
mod kept;
pub mod memory;
mod oom;
mod pool;
pub mod presence;
pub mod probe;
mod processes;
mod progress;
mod retry;
mod signals;
mod state;
mod timeline;
pub mod trainer;
mod waiting;
mod watch;
pub mod worker;

pub use executor::{Executor, JobEnd, JobReport, Runner};
pub use job::{Job, all_jobs, inputs, missing_jobs};
pub use pool::LocalPool;
pub use processes::LocalProcesses;
pub use progress::{Display, left};
pub use signals::{Stop, stop_on_signals};
pub use state::{Counts, FailedJob, Running, SweepState, sweep_state};
pub use timeline::{Spent, Timeline};
