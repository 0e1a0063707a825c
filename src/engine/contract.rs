//! [`Engine`] and [`Session`]: what commands ask of an engine, and what it answers.

use std::time::Duration;

use anyhow::{Result, bail};
use serde_json::Value;

use super::{Cancelled, EngineState, JobReport, SweepRequest, Tell};
use crate::jobs::{Job, ResultsFolder, SweepState};

/// Who brings jobs to their end.
pub trait Engine: Sync {
    /// The name on the command line, and of its section in a sweep file.
    fn name(&self) -> &'static str;

    /// A line for the help.
    fn about(&self) -> &'static str;

    /// Whether jobs leave this machine: then there is something to preview, and its section in the sweep
    /// file may be laid over by a profile.
    fn hands_over(&self) -> bool {
        false
    }

    /// Gets ready for a sweep, before anything is written.
    ///
    /// # Errors
    /// The engine cannot be reached, or cannot do what is asked for.
    fn session<'a>(&self, request: &'a SweepRequest<'a>) -> Result<Box<dyn Session + 'a>>;

    /// What the engine says of a sweep, beside the sweep's folder; `None` where it has nothing of it.
    ///
    /// # Errors
    /// The engine's files cannot be read.
    fn status(&self, _: &ResultsFolder, _: &SweepState) -> Result<Option<EngineState>> {
        Ok(None)
    }

    /// Ends what the engine does for a sweep, with time for checkpoints.
    ///
    /// # Errors
    /// The engine cannot be reached: then nothing is known, and the sweep may go on.
    fn cancel(&self, folder: &ResultsFolder, tell: &dyn Tell) -> Result<Cancelled>;

    /// Does a task that the engine handed to another machine; its exit code.
    ///
    /// # Errors
    /// Files of the submission are damaged or do not appear.
    fn task(&self, _: &ResultsFolder, _: &Task, _say: &dyn Fn(&str)) -> Result<i32> {
        bail!("the engine {} has no tasks", self.name())
    }

    /// What a fit after the tasks of a submission is to wait for.
    ///
    /// # Errors
    /// Files of the submission are damaged.
    fn fit_terms(&self, _: &ResultsFolder, _submission: Option<u32>) -> Result<FitTerms> {
        Ok(FitTerms::default())
    }
}

/// An engine that is about to work on a sweep.
pub trait Session {
    /// Looks, once the folder is held, at what it must know before anything is written.
    ///
    /// # Errors
    /// The engine cannot be reached; nothing was changed.
    fn begin(&mut self) -> Result<()> {
        Ok(())
    }

    /// Brings jobs to their end, each after what it needs, or hands them over.
    ///
    /// # Errors
    /// The engine cannot be used.
    fn bring(self: Box<Self>, jobs: Vec<Job>) -> Result<Brought>;

    /// Says what would be handed over, or whether it would be taken; changes nothing.
    ///
    /// # Errors
    /// The engine has nothing to preview, or cannot be reached.
    fn preview(&mut self, _: Preview, _: Vec<Job>) -> Result<Previewed> {
        bail!("the engine hands nothing over, so there is nothing to preview")
    }
}

/// What became of jobs.
pub enum Brought {
    /// They have ended so.
    Ended(Vec<JobReport>),
    /// They end later, somewhere else: what to tell of that.
    HandedOver { document: Value, text: String },
}

/// What is asked of an engine without handing it anything.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preview {
    /// What would be handed over.
    DryRun,
    /// Whether it would be taken.
    Check,
}

/// What a preview shows.
pub struct Previewed {
    pub document: Value,
    pub text: String,
    /// Whether it would be taken, as far as that was asked.
    pub taken: bool,
}

/// A task of a submission.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Task {
    pub submission: u32,
    pub array: String,
    pub index: usize,
}

/// What a fit waits for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FitTerms {
    /// How long records written on other machines may take to appear.
    pub grace: Duration,
    /// Whether laws are fitted although runs are missing.
    pub allow_missing: bool,
}
