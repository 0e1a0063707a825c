//! [`Parts`]: codes kept while a data set is tokenised, so that a killed process loses little.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use crate::data::Split;
use crate::files::FileError;
use crate::files::columns::{MappedFile, NewColumn, write};
use crate::progress::Stop;

/// Batches of a part: about 130,000 frames.
pub const BATCHES: usize = 64;

/// Where the codes of batches are kept until those of all are there, and the flag that stops between parts.
#[derive(Clone, Copy, Debug)]
pub struct Parts<'a> {
    /// Made where it is missing.
    pub folder: &'a Path,
    pub stop: &'a Stop,
}

impl Parts<'_> {
    /// The file of a split's part; its name says how many there are.
    pub fn file(&self, split: Split, part: usize, n_parts: usize) -> PathBuf {
        self.folder.join(format!("{}-{part}-of-{n_parts}.safetensors", split.name()))
    }
}

/// The share of a data set whose codes are kept; 0 where none are. Parts count alike.
pub fn share_kept(folder: &Path) -> f64 {
    let names = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names: Vec<String> =
        names.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    let n_parts = |split: Split| {
        let of = names.iter().filter(|name| name.starts_with(split.name()));
        let total =
            of.filter_map(|name| name.split_once("-of-")?.1.split('.').next()?.parse().ok());
        total.max().unwrap_or(0)
    };
    // Splits are tokenised in turn, the training split first and by far the longest.
    let total: usize = Split::ALL.into_iter().map(n_parts).sum();
    let kept = names.iter().filter(|name| name.ends_with(".safetensors")).count();
    if total == 0 { 0.0 } else { (kept as f64 / total as f64).min(1.0) }
}

/// Keeps the codes of a part's batches, whole, by rename.
///
/// # Errors
/// [`FileError::Write`].
pub fn keep(path: &Path, batches: &[Vec<u32>]) -> Result<(), FileError> {
    let codes = batches.concat();
    let lengths: Vec<u64> = batches.iter().map(|codes| codes.len() as u64).collect();
    write(path, &[NewColumn::new(CODES, &codes), NewColumn::new(LENGTHS, &lengths)], HashMap::new())
}

/// The codes of a part's batches; `None` where they are not kept, or not whole.
pub fn kept(path: &Path) -> Option<Vec<Vec<u32>>> {
    let file = MappedFile::open(path).ok()?;
    let (codes, lengths) = (file.column::<u32>(CODES).ok()?, file.column::<u64>(LENGTHS).ok()?);
    let mut rest = codes.values();
    let batch = |length: &u64| {
        let (own, others) = rest.split_at_checked(*length as usize)?;
        rest = others;
        Some(own.to_vec())
    };
    let batches: Option<Vec<Vec<u32>>> = lengths.values().iter().map(batch).collect();
    batches.filter(|_| rest.is_empty())
}

const CODES: &str = "codes";
const LENGTHS: &str = "lengths";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_read_as_it_was_kept_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let stop = Stop::default();
        let parts = Parts { folder: folder.path(), stop: &stop };
        assert_eq!(share_kept(folder.path()), 0.0);
        let path = parts.file(Split::Train, 0, 4);
        let batches = vec![vec![3, 1, 4], vec![], vec![1, 5]];
        keep(&path, &batches).unwrap();
        assert_eq!((kept(&path), share_kept(folder.path())), (Some(batches), 0.25));
        let bytes = std::fs::read(&path).unwrap();
        for end in [0, 7, bytes.len() - 1] {
            std::fs::write(&path, &bytes[..end]).unwrap();
            assert_eq!(kept(&path), None, "{end}");
        }
        assert_eq!(kept(&parts.file(Split::Train, 1, 4)), None);
    }
}
