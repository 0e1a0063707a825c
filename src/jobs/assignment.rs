//! [`Assignment`]: the job of a worker, and the repair of damaged files.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Result, bail};
use burn::tensor::Device;
use serde::de::DeserializeOwned;

use super::folder::{CHECKPOINT, ResultsFolder};
use super::job::JobId;
use super::presence::claim;
use crate::data::{self, MotionSource};
use crate::failure::Failure;
use crate::files::{FileError, set_aside};
use crate::learn::{LearnError, TrainingError};
use crate::progress::Stop;
use crate::sweep::Sweep;

/// The weights of a finished run, in its folder.
pub const MODEL: &str = "model.safetensors";
/// The note in that file that names the run.
pub const OF_RUN: &str = "run";

/// Its notes.
pub fn weights_notes(run_id: &str) -> BTreeMap<String, String> {
    BTreeMap::from([(OF_RUN.to_string(), run_id.to_string())])
}

/// The validation curve of a finished run, a line a measurement, in its folder.
pub const LOG: &str = "log.jsonl";
/// The file of a finished run's results on each clip of the test split, one line per clip.
pub const TEST_CLIPS: &str = "test.jsonl";

/// How a job ended, seen from inside.
pub enum Outcome {
    Done,
    Stopped,
    Failed(Failure),
}

/// A job in the hands of a worker.
#[derive(Clone, Copy)]
pub struct Assignment<'a> {
    pub folder: &'a ResultsFolder,
    pub job: &'a JobId,
    pub device: &'a Device,
    /// As `--device` takes it, for the record.
    pub device_name: &'a str,
    pub stop: &'a Stop,
}

impl<'a> Assignment<'a> {
    /// The same for a dependency.
    pub fn of<'b>(&self, job: &'b JobId) -> Assignment<'b>
    where
        'a: 'b,
    {
        Assignment { job, ..*self }
    }

    /// The job's folder.
    pub fn place(&self) -> PathBuf {
        self.folder.job(self.job)
    }

    /// The state that the job goes on from.
    pub fn checkpoint(&self) -> PathBuf {
        self.folder.checkpoint(self.job)
    }

    /// The path of the job's result.
    pub fn product(&self) -> PathBuf {
        self.folder.product(self.job)
    }

    /// The specification of the job.
    ///
    /// # Errors
    /// The file is missing or damaged.
    pub fn spec<T: DeserializeOwned>(&self) -> Result<T> {
        spec_of(self.folder, self.job)
    }

    /// The sweep as it was resolved when the folder was made.
    ///
    /// # Errors
    /// The file is missing or damaged.
    pub fn sweep(&self) -> Result<Sweep> {
        Ok(self.folder.sweep()?)
    }

    /// Opens the motion of the sweep.
    ///
    /// # Errors
    /// It cannot be opened.
    pub fn source(&self) -> Result<Box<dyn MotionSource>> {
        Ok(data::open(&self.sweep()?.data, None)?)
    }

    /// Time between checkpoints.
    ///
    /// # Errors
    /// The sweep cannot be read.
    pub fn checkpoint_every(&self) -> Result<Duration> {
        Ok(self.sweep()?.train.checkpoint_every())
    }

    /// The end of a job that is done: it needs no checkpoint any more.
    ///
    /// # Errors
    /// The folder cannot be written to.
    pub fn done(&self) -> Result<Outcome> {
        let checkpoint = self.place().join(CHECKPOINT);
        if checkpoint.exists() {
            fs::remove_dir_all(checkpoint)?;
        }
        Ok(Outcome::Done)
    }
}

/// The specification of a job.
///
/// # Errors
/// The file is missing or damaged.
pub fn spec_of<T: DeserializeOwned>(folder: &ResultsFolder, job: &JobId) -> Result<T> {
    let missing = || format!("{} is missing", folder.spec(job).display());
    folder.read_spec(job)?.with_context(missing)
}

// Files that are damaged are made again: results depend on neither.

/// Sets aside a file that is damaged, and says so in the log.
///
/// # Errors
/// The folder cannot be written to.
#[expect(clippy::print_stderr, reason = "what a worker writes there is the log of its job")]
pub fn put_away(path: &Path, error: &FileError, instead: &str) -> Result<()> {
    if let Some(aside) = set_aside(path)? {
        eprintln!("warning: {error}; it is set aside as {} and {instead}", aside.display());
    }
    Ok(())
}

/// Trains; if a state to start from is damaged, trains again without it. `None` if stopped.
///
/// # Errors
/// Training failed, or the folder cannot be written to.
pub fn train_past_damage<T, E: TrainingError + Into<anyhow::Error>>(
    states: &[&Path],
    mut train: impl FnMut() -> Result<T, E>,
) -> Result<Option<T>> {
    loop {
        let error = match train() {
            Ok(trained) => return Ok(Some(trained)),
            Err(error) => error,
        };
        match error.learn_error() {
            Some(LearnError::Stopped { .. }) => return Ok(None),
            Some(LearnError::File(file)) if file.is_damage() && states.contains(&file.path()) => {
                put_away(file.path(), file, "training begins without it")?;
            }
            _ => return Err(error.into()),
        }
    }
}

/// Opens the product of a job; if it is damaged or gone, the job is first run again here, by `work`.
///
/// Workers that need the same file wait for the worker that makes it.
///
/// # Errors
/// It can neither be opened nor made.
pub fn open_or_remake<T>(
    assignment: &Assignment,
    job: &JobId,
    open: impl Fn(&Path) -> Result<T, FileError>,
    work: fn(&Assignment) -> Result<Outcome>,
) -> Result<T> {
    let path = assignment.folder.product(job);
    let error = match open(&path) {
        Ok(opened) => return Ok(opened),
        Err(error) if error.is_damage() => error,
        Err(error) => return Err(error.into()),
    };
    let place = assignment.folder.job(job);
    fs::create_dir_all(&place).map_err(FileError::write(&place))?;
    let lock = claim(&place, assignment.stop).with_context(|| format!("making {job} again"))?;
    let Some(_lock) = lock else { bail!("stopped while {job} was made again") };
    if let Ok(mended) = open(&path) {
        return Ok(mended);
    }
    put_away(&path, &error, "made again")?;
    work(&assignment.of(job))?;
    Ok(open(&path)?)
}
