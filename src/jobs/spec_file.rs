//! Specs of jobs as files, in folders that are named by their content.

use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::folder::ResultsFolder;
use super::id::JobId;
use super::kind::JobKind;
use crate::files::{FileError, atomic, read_if_there};
use crate::plan::Plan;

/// Writes the specs of a plan's jobs into its folder; `warn` is told of each that was not as planned.
///
/// Which trunk a trunk goes on from depends on the sweep's budgets; its result does not. So those specs are written
/// again each time.
///
/// # Errors
/// The folder cannot be written to.
pub fn write_specs(
    plan: &Plan,
    folder: &ResultsFolder,
    warn: &mut dyn FnMut(String),
) -> Result<(), FileError> {
    let path = |kind: JobKind, id: &str| folder.file(kind.spec(id));
    for job in &plan.tokenizers {
        write_once(&path(JobKind::Tokenizer, &job.id()), job, warn)?;
    }
    for trunk in &plan.trunks {
        atomic::write_json(&path(JobKind::Trunk, &trunk.trunk_id), trunk)?;
    }
    for run in &plan.runs {
        let path = path(JobKind::Run, &run.run_id);
        let is_done = folder.product(&JobId::run(&run.run_id)).exists();
        if !is_done || !path.exists() {
            write_once(&path, &run.spec, warn)?;
        }
    }
    if let Some(job) = &plan.evaluator {
        write_once(&path(JobKind::Evaluator, &job.id()), job, warn)?;
    }
    for job in &plan.scores {
        write_once(&path(JobKind::Score, &job.id()), job, warn)?;
    }
    Ok(())
}

/// Writes a spec, unless it is there: one that is there is right unless it is damaged, and then it
/// is written again, so there is no need to wait for the disk.
fn write_once<T>(path: &Path, value: &T, warn: &mut dyn FnMut(String)) -> Result<(), FileError>
where
    T: Serialize + DeserializeOwned + PartialEq,
{
    match read_if_there::<T>(path) {
        Ok(Some(there)) if there == *value => return Ok(()),
        Ok(None) => {}
        Ok(Some(_)) => warn(format!("{} differs from the plan; rewritten", path.display())),
        Err(error) => warn(format!("{error}: done")),
    }
    atomic::write_json_unflushed(path, value)
}
