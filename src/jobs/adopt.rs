//! What another sweep's folder has made already.

use std::fs;
use std::path::Path;

use super::folder::{JobState, ResultsFolder};
use super::graph::inputs;
use super::id::JobId;
use crate::files::{FileError, atomic};
use crate::plan::Plan;

/// Copies the captions, tokenizers and codes of a plan that are done in `from` and not in `to`. Ids are
/// by content, so what has the same id is the same.
///
/// # Errors
/// A file cannot be read or written.
pub fn adopt(plan: &Plan, from: &ResultsFolder, to: &ResultsFolder) -> Result<(), FileError> {
    let is_new =
        |id: &JobId| from.state(id) == JobState::Done && matches!(to.state(id), JobState::Missing);
    let jobs = inputs(plan).into_iter().map(|job| job.id);
    jobs.filter(is_new).try_for_each(|id| copy(&id, from, to))
}

/// The product last: a job is done from then on.
fn copy(id: &JobId, from: &ResultsFolder, to: &ResultsFolder) -> Result<(), FileError> {
    let (source, product) = (from.job(id), from.product(id));
    let entries = fs::read_dir(&source).map_err(FileError::read(&source))?;
    let paths = entries.flatten().map(|entry| entry.path());
    for path in paths.filter(|path| path.is_file() && *path != product) {
        copy_whole(&path, &to.job(id))?;
    }
    copy_whole(&product, &to.job(id))
}

fn copy_whole(file: &Path, folder: &Path) -> Result<(), FileError> {
    let bytes = fs::read(file).map_err(FileError::read(file))?;
    atomic::write_bytes(&folder.join(file.file_name().unwrap_or_default()), &bytes)
}
