//! Files that are not what was written: told from files that cannot be read now, and set aside.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::failure::os_error;

/// Whether the reason why a file could not be read lies in the file: it is there and wrong, or gone.
/// What the system refuses (memory, rights, a disk that fails) says nothing about it.
pub fn is_damage(reason: &str) -> bool {
    matches!(os_error(reason), None | Some(2))
}

/// Moves a file to `damaged-NAME` beside it, in place of an older one; where it now lies, or `None`
/// where it is gone already.
///
/// # Errors
/// The folder cannot be written to.
pub fn set_aside(path: &Path) -> io::Result<Option<PathBuf>> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let aside = path.with_file_name(format!("damaged-{name}"));
    match fs::rename(path, &aside) {
        Ok(()) => Ok(Some(aside)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => {
            let said = format!("{} {}: {error}", super::atomic::CANNOT_WRITE, aside.display());
            Err(io::Error::new(error.kind(), said))
        }
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

    #[test]
    fn what_cannot_be_read_now_is_not_damaged() {
        let reason = |code| io::Error::from_raw_os_error(code).to_string();
        assert!(is_damage("invalid header") && is_damage(&reason(2)));
        assert!(![5, 12, 13, 24].iter().any(|code| is_damage(&reason(*code))));
    }
}
