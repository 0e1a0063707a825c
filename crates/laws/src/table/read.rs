//! Reads a file into a [`Table`].

use std::path::Path;

use super::error::ReadProblem;
use super::{Table, csv, written};

/// Why a file gives no table.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {problem}")]
pub struct ReadError {
    pub path: String,
    pub problem: ReadProblem,
}

/// Reads a table; the extension (`.csv`, `.txt`, `.tsv`, `.parquet`) says what it is.
///
/// # Errors
/// The path, and what is wrong on which line. A table without rows is an error.
pub fn read(path: &Path) -> Result<Table, ReadError> {
    contents(path)
        .and_then(checked)
        .map(written::read)
        .map_err(|problem| ReadError { path: path.display().to_string(), problem })
}

fn contents(path: &Path) -> Result<Table, ReadProblem> {
    let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
    // A device or a pipe may have no end.
    let is_endless = std::fs::metadata(path).is_ok_and(|about| !about.is_file() && !about.is_dir());
    if is_endless {
        let problem = "it is a device or a pipe, and no regular file".to_string();
        return Err(ReadProblem::Unreadable(problem));
    }
    let bytes = || std::fs::read(path).map_err(|e| ReadProblem::Unreadable(e.to_string()));
    match extension.to_str() {
        Some("csv" | "txt") => {
            let bytes = bytes()?;
            let text = utf8(&bytes)?;
            let separator = csv::separator(text);
            let mut table = csv::table(text, separator)?;
            table.notes.extend(csv::note(separator));
            Ok(table)
        }
        Some("tsv") => csv::table(utf8(&bytes()?)?, b'\t'),
        #[cfg(feature = "parquet")]
        Some("parquet") => super::parquet::table(bytes()?),
        #[cfg(not(feature = "parquet"))]
        Some("parquet") => Err(ReadProblem::Unreadable(NO_PARQUET.to_string())),
        _ => Err(ReadProblem::Extension),
    }
}

#[cfg(not(feature = "parquet"))]
const NO_PARQUET: &str = "this build has no feature `parquet`; save the table as CSV";

fn utf8(bytes: &[u8]) -> Result<&str, ReadProblem> {
    std::str::from_utf8(bytes).map_err(|error| {
        let before = &bytes[..error.valid_up_to()];
        ReadProblem::NotUtf8 { line: 1 + before.iter().filter(|b| **b == b'\n').count() }
    })
}

fn checked(table: Table) -> Result<Table, ReadProblem> {
    let mut places = std::collections::HashMap::new();
    for (i, name) in table.names().enumerate() {
        if let Some(first) = places.insert(name, i + 1) {
            return Err(ReadProblem::RepeatedName { name: name.into(), first, second: i + 1 });
        }
    }
    if table.n_rows == 0 {
        return Err(ReadProblem::NoRows { names: table.listed() });
    }
    Ok(table)
}

#[cfg(all(test, feature = "parquet"))]
mod tests;
