//! How far a sweep is, from its folder alone.

mod look;
mod share;
mod sweep_state;
#[cfg(test)]
mod tests;

pub use sweep_state::{Counts, FailedJob, Running, SweepState};

use crate::files::{FileError, read_if_there};
use crate::jobs::{JobId, ResultsFolder};
use look::{Look, Planned};

/// Seconds until the wanted jobs of a sweep that can still be done are done with so many side by side; `None` if
/// nothing tells how fast its runs are. What is running counts by how far it is.
///
/// # Errors
/// A file is damaged, or cannot be read.
pub fn time_left(
    folder: &ResultsFolder,
    slots: usize,
    wanted: &dyn Fn(&JobId) -> bool,
) -> Result<Option<f64>, FileError> {
    let plan: Option<Planned> = read_if_there(&folder.file("plan.json"))?;
    Ok(plan.and_then(|plan| Look::at(folder, &plan).time_left(slots, wanted)))
}

/// Reads how far a sweep is; `None` where the folder is no sweep's.
///
/// # Errors
/// A file is damaged, or cannot be read.
pub fn sweep_state(folder: &ResultsFolder) -> Result<Option<SweepState>, FileError> {
    let plan: Option<Planned> = read_if_there(&folder.file("plan.json"))?;
    Ok(plan.map(|plan| Look::at(folder, &plan).state()))
}
