//! The ledger: which jobs of Slurm's are ours, written so that a crash at any moment loses none.

use std::{fs, io};

use serde::{Deserialize, Serialize};

use crate::engine::slurm::files::{Generation, SlurmFolder};
use crate::files::{atomic, read_if_there};

/// One call of `sbatch`: what it is to submit, and the number that it gave.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Entry {
    pub generation: Generation,
    pub array: String,
    /// Random; the job carries it as its comment, so that it is found though its number is not known.
    pub token: String,
    /// Who submitted, by number.
    pub user: u32,
    /// Tasks of the array; `None` for a job that is no array.
    pub tasks: Option<usize>,
    /// The job's number; `None` before `sbatch` has said it.
    pub job_id: Option<String>,
    /// Taken back: never submitted, or cancelled since a later call failed.
    pub void: bool,
}

impl SlurmFolder {
    /// Every entry that was not taken back, in the order of submission.
    ///
    /// # Errors
    /// A file is damaged, or cannot be read.
    pub fn entries(&self) -> io::Result<Vec<Entry>> {
        if !self.ledger().exists() {
            return Ok(Vec::new());
        }
        let mut entries: Vec<Entry> = Vec::new();
        for file in fs::read_dir(self.ledger())? {
            let path = file?.path();
            if path.extension().is_some_and(|extension| extension == "json") {
                entries.extend(read_if_there::<Entry>(&path)?);
            }
        }
        entries.retain(|entry| !entry.void);
        let number = |entry: &Entry| entry.job_id.as_ref().and_then(|id| id.parse::<u64>().ok());
        entries.sort_by_key(|entry| (entry.generation, number(entry), entry.array.clone()));
        Ok(entries)
    }

    /// Writes an entry as it is now.
    ///
    /// # Errors
    /// The folder cannot be written to.
    pub fn write(&self, entry: &Entry) -> io::Result<()> {
        let name = format!("{}-{}.json", entry.generation, entry.array);
        Ok(atomic::write_json(&self.ledger().join(name), entry)?)
    }

    /// Takes an entry back.
    ///
    /// # Errors
    /// The folder cannot be written to.
    pub fn take_back(&self, entry: &Entry) -> io::Result<()> {
        self.write(&Entry { void: true, ..entry.clone() })
    }
}

/// A token that no other job has.
pub fn token() -> io::Result<String> {
    let random = tempfile::Builder::new().prefix("").rand_bytes(12).tempfile()?;
    let name = random.path().file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(format!("isoflop-{name}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::ResultsFolder;

    #[test]
    fn what_was_taken_back_is_not_ours_any_more() {
        let place = tempfile::tempdir().unwrap();
        let ledger = SlurmFolder::of(&ResultsFolder::new(place.path()));
        assert_eq!(ledger.entries().unwrap(), []);
        let entry = |array: &str, id: Option<&str>| Entry {
            generation: 1,
            array: array.to_string(),
            token: token().unwrap(),
            user: 0,
            tasks: Some(2),
            job_id: id.map(String::from),
            void: false,
        };
        let (first, second) = (entry("train", Some("9")), entry("fit", Some("10")));
        ledger.write(&second).unwrap();
        ledger.write(&first).unwrap();
        assert_ne!(first.token, second.token);
        assert_eq!(ledger.entries().unwrap(), [first.clone(), second.clone()]);
        ledger.take_back(&first).unwrap();
        assert_eq!(ledger.entries().unwrap(), [second]);
    }
}
