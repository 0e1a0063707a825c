//! [`Assignment`]: a job in the hands of a worker.

use std::fs;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, Result};
use burn::tensor::Device;
use serde::de::DeserializeOwned;

use super::folder::{CHECKPOINT, ResultsFolder};
use super::id::JobId;
use crate::data::{self, MotionSource};
use crate::failure::Failure;
use crate::progress::Stop;
use crate::sweep::{self, Sweep};

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
    /// The same for another job, which has to be done first.
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

    /// Where the job's result lies.
    pub fn product(&self) -> PathBuf {
        self.folder.product(self.job)
    }

    /// What the job is to make.
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
        frozen_sweep(self.folder)
    }

    /// The motion of the sweep.
    ///
    /// # Errors
    /// It cannot be opened.
    pub fn source(&self) -> Result<Box<dyn MotionSource>> {
        Ok(data::open(&self.sweep()?.data, None)?)
    }

    /// How often to leave a checkpoint.
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

/// What a job is to make.
///
/// # Errors
/// The file is missing or damaged.
pub fn spec_of<T: DeserializeOwned>(folder: &ResultsFolder, job: &JobId) -> Result<T> {
    let missing = || format!("{} is missing", folder.spec(job).display());
    folder.read_spec(job)?.with_context(missing)
}

/// The sweep of a folder, as it was resolved when the folder was made.
///
/// # Errors
/// The file is missing or damaged.
pub fn frozen_sweep(folder: &ResultsFolder) -> Result<Sweep> {
    Ok(sweep::read(&folder.file("sweep.yaml"), &[])?)
}
