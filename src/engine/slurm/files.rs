//! [`SlurmFolder`]: what submissions leave in a sweep's folder, under `slurm`.

use std::path::PathBuf;
use std::{fs, io};

use serde::{Deserialize, Serialize};

use crate::jobs::{Job, JobId, ResultsFolder};

/// The number of a submission, from 1.
pub type Generation = u32;

/// A job and how long it takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Timed {
    #[serde(flatten)]
    pub job: Job,
    /// Seconds, by the rate known when it was submitted.
    pub seconds: f64,
}

/// What a task is to do; written once, never changed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChunkFile {
    /// What must be there before: made by other tasks, now or long ago.
    pub needs: Vec<JobId>,
    /// The jobs, the most urgent first.
    pub jobs: Vec<Timed>,
}

/// The folder `slurm` of a sweep's folder:
///
/// ```text
/// bin/<digest>/isoflop          the program that tasks run
/// gen/<g>/submit.json           what was asked for
/// gen/<g>/<array>.sh            the batch script of an array
/// gen/<g>/<array>/<i>.json      the chunk of a task
/// ledger/<g>-<array>.json       written before sbatch is called; the job's number after
/// logs/<g>-<array>-<job>_<i>.log
/// requeues/<g>-<array>-<i>/…    a file each time a task put itself back into the queue
/// ```
#[derive(Clone, Debug)]
pub struct SlurmFolder(PathBuf);

impl SlurmFolder {
    /// That of a sweep's folder; it need not exist.
    pub fn of(folder: &ResultsFolder) -> Self {
        Self(folder.file("slurm"))
    }

    /// The folder of a submission.
    pub fn generation(&self, generation: Generation) -> PathBuf {
        self.0.join("gen").join(generation.to_string())
    }

    /// What a submission asked for.
    pub fn written(&self, generation: Generation) -> PathBuf {
        self.generation(generation).join("submit.json")
    }

    /// The batch script of an array.
    pub fn script(&self, generation: Generation, array: &str) -> PathBuf {
        self.generation(generation).join(format!("{array}.sh"))
    }

    /// The chunk of a task.
    pub fn chunk(&self, generation: Generation, array: &str, index: usize) -> PathBuf {
        self.generation(generation).join(array).join(format!("{index}.json"))
    }

    /// The folder of the logs: without it, no job of Slurm's would start.
    pub fn logs(&self) -> PathBuf {
        self.0.join("logs")
    }

    /// The folder of the ledger.
    pub fn ledger(&self) -> PathBuf {
        self.0.join("ledger")
    }

    /// Where the program of a digest lies.
    pub fn program(&self, digest: &str) -> PathBuf {
        self.0.join("bin").join(digest).join("isoflop")
    }

    /// Where a task notes that it put itself back into the queue.
    pub fn requeues(&self, generation: Generation, array: &str, index: usize) -> PathBuf {
        self.0.join("requeues").join(format!("{generation}-{array}-{index}"))
    }

    /// The number of the last submission; `None` where there was none.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub fn latest(&self) -> io::Result<Option<Generation>> {
        let folder = self.0.join("gen");
        if !folder.exists() {
            return Ok(None);
        }
        let mut latest = None;
        for entry in fs::read_dir(folder)? {
            let number = entry?.file_name().to_str().and_then(|name| name.parse().ok());
            latest = latest.max(number);
        }
        Ok(latest)
    }
}
