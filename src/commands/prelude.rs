//! Common imports of commands, by `use super::prelude::*`.

pub use std::collections::BTreeMap;
pub use std::fmt::Write as _;
pub use std::path::{Path, PathBuf};

pub use anyhow::{Context, Result, bail};
pub use clap::Args;
pub use isoflop::files::{
    FileError, atomic, read_if_there, read_text_if_there, read_yaml_if_there,
};
pub use isoflop::jobs::ResultsFolder;
pub use isoflop::laws::Laws;
pub use isoflop::predict::Prediction;
pub use isoflop::record::RunRecord;
pub use isoflop::spec::FlopsRule;
pub use isoflop::sweep::Sweep;
pub use isoflop::words::wrap;
pub use serde::{Deserialize, Serialize};
pub use serde_json::{Value, json};

pub use super::output::{Exit, Output, clip, dash, listed, many, more, sentence, table};
