//! Sweep files: YAML into a checked [`Sweep`].

mod alternatives;
mod check;
mod command;
pub mod condition;
mod file;
mod layers;
mod locate;
mod merge;
mod model_lists;
mod models;
mod nearest;
mod overrides;
mod plain_words;
pub mod presets;
mod problem;
mod read;
mod reference;
mod removed_entries;
mod sections;
mod source;
mod time_limit;

pub use command::{CommandError, TrainerCommand};
pub use models::{models, shape};
pub use problem::{Problem, SweepErrors};
pub use read::{parse, read, read_profile};
pub use reference::{reference, schema};
pub use sections::*;
pub use source::Source;
pub use time_limit::minutes;
