//! How far a sweep is, from its folder alone.

mod look;
mod sweep_state;
#[cfg(test)]
mod tests;

pub use sweep_state::{Counts, FailedJob, Running, SweepState};

use crate::files::{FileError, read_if_there};
use crate::jobs::ResultsFolder;
use look::{Look, Planned};

/// Reads how far a sweep is; `None` where the folder is no sweep's.
///
/// # Errors
/// A file is damaged, or cannot be read.
pub fn sweep_state(folder: &ResultsFolder) -> Result<Option<SweepState>, FileError> {
    let plan: Option<Planned> = read_if_there(&folder.file("plan.json"))?;
    Ok(plan.map(|plan| Look::at(folder, &plan).state()))
}
