//! Slots of this machine: a worker process a job, watched to its end.

mod curve;
mod display;
mod gpus;
mod pool;
mod processes;
mod retry;
mod session;
mod timeline;
mod waiting;
mod watch;

pub use display::{Display, left};
pub use gpus::Gpus;
pub use pool::LocalPool;
pub use processes::LocalProcesses;
pub use session::Local;
pub use timeline::{Spent, Timeline};
