//! [`Exporter`]: what every form needs to know.

use std::path::PathBuf;

use anyhow::{Result, bail};
use isoflop::jobs::ResultsFolder;

/// From where, and to where.
pub struct Exporter {
    pub folder: ResultsFolder,
    pub out: PathBuf,
}

impl Exporter {
    /// Refuses a folder without files that the form is made of.
    pub fn needs(&self, names: &[&str]) -> Result<()> {
        let missing = names.iter().map(|name| self.folder.file(name)).find(|path| !path.exists());
        match missing {
            Some(path) => bail!("{} is missing; `isoflop run` writes it", path.display()),
            None => Ok(()),
        }
    }
}
