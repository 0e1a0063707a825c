//! JSON files that may be missing or damaged.

use std::io;
use std::path::Path;

use serde::de::DeserializeOwned;

use super::error::FileError;
use super::regular::{LARGE, read_regular, read_text};

/// Reads a JSON file; a missing one is `None`, a damaged one an error that names it.
///
/// # Errors
/// [`FileError::Read`] and [`FileError::Damaged`].
pub fn read_if_there<T: DeserializeOwned>(path: &Path) -> Result<Option<T>, FileError> {
    match read_regular(path, LARGE) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(FileError::read(path)(error)),
        Ok(bytes) => serde_json::from_slice(&bytes).map(Some).map_err(|error| FileError::Damaged {
            path: path.to_path_buf(),
            reason: error.to_string(),
            advice: mended_by(path),
        }),
    }
}

/// Reads a text file; a missing one is `None`.
///
/// # Errors
/// [`FileError::Read`].
pub fn read_text_if_there(path: &Path) -> Result<Option<String>, FileError> {
    match read_text(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(FileError::read(path)(error)),
        Ok(text) => Ok(Some(text)),
    }
}

/// How a damaged file is mended.
fn mended_by(path: &Path) -> &'static str {
    match path.file_name().and_then(|name| name.to_str()).unwrap_or_default() {
        "record.json" => "`isoflop run` sets it aside and trains the run again",
        "metrics.json" => "`isoflop run` sets it aside and trains the tokenizer again",
        "failure.json" => "`isoflop run` with --retry-failed tries the job again",
        "plan.json" | "spec.json" | "job.json" | "laws.json" => "`isoflop run` writes it again",
        _ => "remove it to have it made again",
    }
}
