//! Slots of this machine: a worker process a job, watched to its end.

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
