//! Files that are not what was written are set aside.

use std::path::{Path, PathBuf};
use std::{fs, io};

use super::error::FileError;

/// Moves a file to `damaged-NAME` beside it, in place of an older one; where it now lies, or `None`
/// where it is gone already.
///
/// # Errors
/// The folder cannot be written to.
pub fn set_aside(path: &Path) -> Result<Option<PathBuf>, FileError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let aside = path.with_file_name(format!("damaged-{name}"));
    match fs::rename(path, &aside) {
        Ok(()) => Ok(Some(aside)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(FileError::write(&aside)(error)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_damaged_file_is_kept_beside_and_a_second_look_finds_none() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("record.json");
        fs::write(&path, "{").unwrap();
        let aside = set_aside(&path).unwrap().unwrap();
        assert!(aside.ends_with("damaged-record.json") && aside.exists() && !path.exists());
        assert_eq!(set_aside(&path).unwrap(), None);
    }
}
