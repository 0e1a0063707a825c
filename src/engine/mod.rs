//! Engines run the jobs of a sweep; each has a folder.
//!
//! An [`Engine`] runs jobs, reports their progress and ends them. [`ENGINES`] lists them; commands iterate over it.
//!
//! # Example
//!
//! ```
//! use isoflop::engine::{ENGINES, engine};
//!
//! assert!(engine("slurm").is_some() && engine("cloud").is_none());
//! assert_eq!(ENGINES[0].name(), "local");
//! ```

pub mod local;
mod runner;
pub mod slurm;
pub use runner::{
    Brought, Cancelled, Engine, EngineState, FitTerms, JobEnd, JobReport, Preview, Previewed,
    Runner, Session, SweepRequest, Task, Tell, Track,
};

/// Every engine, the default first.
pub static ENGINES: [&dyn Engine; 2] = [&local::Local, &slurm::Slurm];

/// The engine of a name.
pub fn engine(name: &str) -> Option<&'static dyn Engine> {
    ENGINES.into_iter().find(|engine| engine.name() == name)
}
