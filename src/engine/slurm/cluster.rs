//! [`Cluster`]: a request to be met by Slurm, and what was submitted before.

use std::path::absolute;

use anyhow::Result;

use super::files::{Generation, SlurmFolder};
use super::ledger::Entry;
use super::queue::Queue;
use super::settings::Settings;
use super::submission::SubmissionTerms;
use crate::engine::SweepRequest;
use crate::files::read_if_there;
use crate::jobs::ResultsFolder;

/// A request to be met by a cluster.
pub(super) struct Cluster<'a> {
    pub request: &'a SweepRequest<'a>,
    /// Named by its full path.
    pub folder: ResultsFolder,
    pub settings: Settings,
    /// What was submitted before.
    pub entries: Vec<Entry>,
    pub queue: Queue,
    /// MaxArraySize, as Slurm says.
    pub asked: Option<usize>,
}

/// The settings and the ledger of a folder that a command looks into; `None` where nothing was ever
/// submitted from it.
pub fn of_folder(folder: &ResultsFolder) -> Result<Option<(Settings, Vec<Entry>)>> {
    let folder = ResultsFolder::new(absolute(folder.root())?);
    let files = SlurmFolder::of(&folder);
    let Some(generation) = files.latest()? else { return Ok(None) };
    let settings = settings_of(&files, Some(generation))?;
    Ok(Some((settings, files.entries()?)))
}

/// The settings of a submission; the defaults where there is none.
pub fn settings_of(files: &SlurmFolder, submission: Option<Generation>) -> Result<Settings> {
    let written = match submission {
        Some(generation) => read_if_there::<SubmissionTerms>(&files.written(generation))?,
        None => None,
    };
    Ok(written.map(|written| written.settings).unwrap_or_default())
}
