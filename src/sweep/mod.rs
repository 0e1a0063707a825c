//! Sweep files: YAML into a checked [`Sweep`].

mod check;
mod check_engine;
mod choice;
mod command;
pub mod condition;
mod locate;
mod number;
mod overrides;
pub mod presets;
mod problem;
mod read;
mod repeated;
mod spec;
mod taken_out;
mod time_limit;

pub use command::{CommandError, TrainerCommand};
pub use problem::{Problem, SweepErrors};
pub use read::{parse, read, read_profile};
pub use spec::*;
pub use time_limit::minutes;
