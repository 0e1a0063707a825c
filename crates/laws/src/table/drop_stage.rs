//! What dropped a row of a table.

use std::fmt;

use serde::{Serialize, Serializer};

use super::OutlierStage;

/// What dropped a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DropStage {
    /// A cell that is needed is empty.
    Missing,
    /// It is the copy of a row before it.
    Copy,
    /// `--drop-highest`.
    DropHighest,
    Outliers(OutlierStage),
}

impl fmt::Display for DropStage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing => f.pad("missing"),
            Self::Copy => f.pad("copy"),
            Self::DropHighest => f.pad("drop-highest"),
            Self::Outliers(stage) => stage.fmt(f),
        }
    }
}

impl Serialize for DropStage {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
