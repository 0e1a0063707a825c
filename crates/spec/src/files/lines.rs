//! Files of JSON lines, of which the whole lines of a damaged one are read.

use std::path::Path;

use serde::de::DeserializeOwned;

use super::{FileError, LARGE, digest, if_there, read_regular};

/// The lines of a file.
#[derive(Debug, PartialEq)]
pub struct Lines<T> {
    pub whole: Vec<T>,
    /// The damage of the file, if any: it is empty, some lines are no JSON, or its digest is that of other bytes.
    pub damage: Option<String>,
}

/// Reads the lines of a file; a missing one is `None`.
///
/// # Errors
/// [`FileError::Read`].
pub fn read_lines<T: DeserializeOwned>(path: &Path) -> Result<Option<Lines<T>>, FileError> {
    let bytes = if_there(path, read_regular(path, LARGE))?;
    Ok(bytes.map(lines))
}

fn lines<T: DeserializeOwned>(bytes: Vec<u8>) -> Lines<T> {
    let is_changed = digest::is_wrong(&bytes);
    let bytes = digest::without(bytes);
    let all = bytes.split(|byte| *byte == b'\n').filter(|line| !line.trim_ascii().is_empty());
    let read: Vec<Option<T>> = all.map(|line| serde_json::from_slice(line).ok()).collect();
    let n = read.len();
    let whole: Vec<T> = read.into_iter().flatten().collect();
    let damage = match whole.len() {
        0 if n == 0 => Some("it is empty".to_string()),
        read if read < n => Some(format!("{} of its {n} lines cannot be read", n - read)),
        _ => is_changed.then(|| "its bytes are not those that were written".to_string()),
    };
    Lines { whole, damage }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::atomic::write_json_lines;
    use std::collections::BTreeMap;

    type Line = BTreeMap<String, f64>;

    fn read(bytes: &[u8]) -> (usize, String) {
        let Lines { whole, damage } = lines::<Line>(bytes.to_vec());
        (whole.len(), damage.unwrap_or_default())
    }

    #[test]
    fn a_cut_or_a_changed_number_is_told_and_whole_lines_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.jsonl");
        assert_eq!(read_lines::<Line>(&path).unwrap(), None);
        let line = |loss| Line::from([("loss".to_string(), loss)]);
        let written = [1.5, 2.5, 3.5].map(line);
        write_json_lines(&path, &written).unwrap();
        let found = read_lines::<Line>(&path).unwrap().unwrap();
        assert_eq!(found, Lines { whole: written.to_vec(), damage: None });
        let bytes = std::fs::read(&path).unwrap();
        let ends: Vec<usize> = (1..=bytes.len()).filter(|at| bytes[at - 1] == b'\n').collect();
        assert_eq!(read(&bytes[..ends[1] + 5]), (2, "1 of its 3 lines cannot be read".into()));
        let (n, damage) = read(&bytes[..ends[1]]);
        assert!(n == 2 && damage.contains("not those that were written"), "{damage}");
        let changed = String::from_utf8(bytes).unwrap().replace("2.5", "2.7");
        let (n, damage) = read(changed.as_bytes());
        assert!(n == 3 && damage.contains("not those that were written"), "{damage}");
        assert_eq!(read(b"\n"), (0, "it is empty".into()));
    }

    #[test]
    fn lines_without_a_digest_are_whole() {
        assert_eq!(read(b"{\"loss\": 1}\n{\"loss\": 2}\n"), (2, String::new()));
    }
}
