//! Specs of jobs as files, in folders that are named by their content.

use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::files::{FileError, atomic, read_if_there};

/// Writes a spec, unless it is there: one that is there is right unless it is damaged, and then it
/// is written again, so there is no need to wait for the disk.
///
/// # Errors
/// The folder cannot be written to.
pub fn write_once<T>(path: &Path, value: &T, warn: &mut dyn FnMut(String)) -> Result<(), FileError>
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
