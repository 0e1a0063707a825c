//! Runs jobs on this machine: one watched worker process per job.

mod curve;
mod display;
mod gpus;
mod pool;
mod processes;
mod session;
mod timeline;
pub use display::{Display, left};
pub use gpus::Gpus;
pub use pool::LocalPool;
pub use processes::LocalProcesses;
pub use session::Local;
