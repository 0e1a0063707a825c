//! Sweep files: YAML into a checked [`Sweep`].
//!
//! # Example
//!
//! ```
//! use isoflop::sweep;
//!
//! let text = "name: first\ngrid: {models: scamo, vocab: [256], budgets: [1e18]}\n";
//! let sweep = sweep::parse("first.yaml", text, &["seeds=[0, 1]".to_string()])?;
//! assert_eq!((sweep.grid.budgets, sweep.seeds), (vec![1e18], vec![0, 1]));
//!
//! let slip = sweep::parse("first.yaml", &text.replace("vocab", "vocabs"), &[]).unwrap_err();
//! assert!(slip.to_string().contains("first.yaml:2:23") && slip.to_string().contains("`vocab`"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod alternatives;
mod bounded;
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
mod variants;

pub use command::{CommandError, TrainerCommand};
pub use models::{models, shape};
pub use problem::{Problem, SweepErrors};
pub use read::{parse, read, read_profile};
pub use reference::{reference, schema};
pub use sections::*;
pub use source::Source;
pub use time_limit::minutes;
pub use variants::Variant;
