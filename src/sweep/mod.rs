//! Sweep files: YAML into a checked [`Sweep`].

mod check;
mod choice;
mod command;
pub mod condition;
mod locate;
mod models;
mod nearest;
mod overrides;
pub mod presets;
mod problem;
mod read;
mod reference;
mod sections;
mod taken_out;
mod time_limit;

pub use command::{CommandError, TrainerCommand};
pub use models::{models, shape};
pub use problem::{Problem, SweepErrors};
pub use read::{parse, read, read_profile};
pub use reference::reference;
pub use sections::*;
pub use time_limit::minutes;
