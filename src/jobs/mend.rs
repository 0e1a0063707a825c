//! Files that a worker finds damaged are made again: results depend on neither.

use std::path::Path;

use anyhow::{Context, Result, bail};

use super::assignment::{Assignment, Outcome};
use super::id::JobId;
use super::presence::claim;
use crate::files::FileError;
use crate::files::set_aside;
use crate::learn::LearnError;

/// Sets aside a file that is damaged, and says so in the log.
///
/// # Errors
/// The folder cannot be written to.
#[expect(clippy::print_stderr, reason = "what a worker writes there is the log of its job")]
pub fn put_away(path: &Path, error: &FileError, instead: &str) -> Result<()> {
    if let Some(aside) = set_aside(path)? {
        eprintln!("warning: {error}; it is set aside as {} and {instead}", aside.display());
    }
    Ok(())
}

/// Trains; where one of the states that training may begin from turns out to be damaged, again without
/// it. `None`: stopped.
///
/// # Errors
/// Training failed, or the folder cannot be written to.
pub fn train_past_damage<T, E: Into<anyhow::Error>>(
    states: &[&Path],
    learn_error: fn(&E) -> Option<&LearnError>,
    mut train: impl FnMut() -> Result<T, E>,
) -> Result<Option<T>> {
    loop {
        let error = match train() {
            Ok(trained) => return Ok(Some(trained)),
            Err(error) => error,
        };
        match learn_error(&error) {
            Some(LearnError::Stopped { .. }) => return Ok(None),
            Some(LearnError::File(file)) if file.is_damage() && states.contains(&file.path()) => {
                put_away(file.path(), file, "training begins without it")?;
            }
            _ => return Err(error.into()),
        }
    }
}

/// What a job has made, opened; where it is damaged or gone, the job is done again here first, by `work`.
///
/// Workers that need the same file wait for the one that makes it.
///
/// # Errors
/// It can neither be opened nor made.
pub fn open_or_remake<T>(
    assignment: &Assignment,
    job: &JobId,
    open: impl Fn(&Path) -> Result<T, FileError>,
    work: fn(&Assignment) -> Result<Outcome>,
) -> Result<T> {
    let path = assignment.folder.product(job);
    let error = match open(&path) {
        Ok(opened) => return Ok(opened),
        Err(error) if error.is_damage() => error,
        Err(error) => return Err(error.into()),
    };
    let place = assignment.folder.job(job);
    std::fs::create_dir_all(&place).map_err(FileError::write(&place))?;
    let lock = claim(&place, assignment.stop).with_context(|| format!("making {job} again"))?;
    let Some(_lock) = lock else { bail!("stopped while {job} was made again") };
    if let Ok(mended) = open(&path) {
        return Ok(mended);
    }
    put_away(&path, &error, "made again")?;
    work(&assignment.of(job))?;
    Ok(open(&path)?)
}
