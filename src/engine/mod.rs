//! Who brings the jobs of a sweep to their end: a folder an engine.
//!
//! An [`Engine`] takes jobs, tells how far they are and ends them. [`ENGINES`] lists them; commands
//! iterate, and name none.
//!
//! # Example
//!
//! ```
//! use isoflop::engine::{ENGINES, engine};
//!
//! assert!(engine("slurm").is_some() && engine("cloud").is_none());
//! assert_eq!(ENGINES[0].name(), "local");
//! ```

mod contract;
mod engine_state;
pub mod local;
mod request;
mod runner;
pub mod slurm;
mod track;

pub use contract::{Brought, Engine, FitTerms, Preview, Previewed, Session, Task};
pub use engine_state::{Cancelled, EngineState};
pub use request::{SweepRequest, Tell};
pub use runner::{JobEnd, JobReport, Runner};
pub use track::Track;

/// Every engine, the default first.
pub static ENGINES: [&dyn Engine; 2] = [&local::Local, &slurm::Slurm];

/// The engine of a name.
pub fn engine(name: &str) -> Option<&'static dyn Engine> {
    ENGINES.into_iter().find(|engine| engine.name() == name)
}
