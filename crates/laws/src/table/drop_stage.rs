//! What dropped a row of a table.

use std::fmt;

use serde::Serialize;

use super::OutlierStage;

/// What dropped a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum DropStage {
    /// A cell that is needed is empty.
    Missing,
    /// It is the copy of a row before it.
    Copy,
    /// `--drop-highest`.
    DropHighest,
    #[serde(untagged)]
    Outliers(OutlierStage),
}

impl fmt::Display for DropStage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}
