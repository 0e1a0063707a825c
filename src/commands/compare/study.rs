//! [`Study`]: laws by a name.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use isoflop::jobs::ResultsFolder;
use isoflop::laws::Laws;

use crate::commands::predict::laws_named;

/// A study by its name.
pub struct Study {
    pub name: String,
    /// Through all budgets.
    pub laws: Laws,
    pub path: PathBuf,
}

impl Study {
    /// Of a folder, a file, or `scamo`.
    pub fn of(given: &str) -> Result<Self> {
        let path = PathBuf::from(given);
        let laws = laws_named(given)?.clone();
        if laws.power_laws.tokens.is_none() {
            bail!("{given} holds no power laws to compare");
        }
        Ok(Self { name: name(&path), laws, path })
    }
}

/// A folder's name, or a file's without its ending; that of the folder for a `laws.json`.
fn name(path: &Path) -> String {
    if path.is_dir() {
        return ResultsFolder::new(path).name();
    }
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let folder = path.parent().and_then(Path::file_name).filter(|_| stem == "laws");
    folder.map_or(stem, |folder| folder.to_string_lossy().into_owned())
}
