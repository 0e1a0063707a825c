//! [`Runner`]: runs a single job, and reports its end.

use crate::failure::{Consequence, Failure};
use crate::jobs::{Job, ResultsFolder, SweepState};
use crate::ops::DeviceName;
use crate::plan::Plan;
use crate::progress::{Beat, Stop};
use crate::sweep::Sweep;
use anyhow::{Result, bail};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::Path;
use std::time::Duration;

/// How a job ended.
#[derive(Clone, Debug, PartialEq)]
pub enum JobEnd {
    Done,
    /// It failed for good; the reason is also in its folder.
    Failed(Failure),
    /// It was asked to stop, and can resume from its checkpoint.
    Stopped,
    /// Its process died or was killed; a retry may succeed.
    Crashed(Failure),
    /// Nothing can be written: neither by this job nor by others. It goes on another time.
    Halted(Failure),
}

impl JobEnd {
    /// How a job ends that failed so.
    pub fn of(failure: Failure) -> Self {
        match failure.kind.consequence() {
            Consequence::Final => Self::Failed(failure),
            Consequence::MayPass => Self::Crashed(failure),
            Consequence::StopsAll => Self::Halted(failure),
        }
    }

    /// `done`, `stopped`, or the kind of failure.
    pub fn word(&self) -> &'static str {
        match (self, self.failure()) {
            (_, Some(failure)) => failure.kind.word(),
            (Self::Done, None) => "done",
            (_, None) => "stopped",
        }
    }

    /// The failure, if any.
    pub fn failure(&self) -> Option<&Failure> {
        match self {
            Self::Failed(failure) | Self::Crashed(failure) | Self::Halted(failure) => Some(failure),
            Self::Done | Self::Stopped => None,
        }
    }
}

/// How one job ended.
#[derive(Clone, Debug, PartialEq)]
pub struct JobReport {
    pub job: Job,
    pub end: JobEnd,
}

/// Does jobs, one call at a time from each of several threads.
pub trait Runner: Sync {
    /// Runs a job; calls `beat` with its progress.
    fn run(&self, job: &Job, stop: &Stop, beat: &mut dyn FnMut(Beat)) -> JobEnd;

    /// Notes for good that a job failed which died too often; returns the failure as noted.
    fn give_up(&self, _: &Job, failure: Failure) -> Failure {
        failure
    }
}

// An engine's report on a sweep.

/// An engine's report on a sweep, in addition to the folder's state.
#[derive(Clone, Debug, PartialEq)]
pub struct EngineState {
    /// For `--json`.
    pub document: Value,
    /// For a person.
    pub text: String,
    /// Whether runs are left that a new submission would hand over.
    pub wants_more: bool,
}

/// The result of a request to end, from the mildest to the worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cancelled {
    NothingRan,
    /// Everything ended within the time given to it.
    Ended,
    /// Something had to be killed; it goes on from its last checkpoint.
    Killed,
    StillAtWork,
}

// [`Engine`] and [`Session`]: the interface between commands and engines.

/// Runs jobs.
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

    /// Prepares a sweep, before anything is written.
    ///
    /// # Errors
    /// The engine cannot be reached, or does not support the request.
    fn session<'a>(&self, request: &'a SweepRequest<'a>) -> Result<Box<dyn Session + 'a>>;

    /// The engine's report on a sweep; `None` if it has no jobs of it.
    ///
    /// # Errors
    /// The engine's files cannot be read.
    fn status(&self, _: &ResultsFolder, _: &SweepState) -> Result<Option<EngineState>> {
        Ok(None)
    }

    /// Ends the engine's jobs of a sweep, with time for checkpoints.
    ///
    /// # Errors
    /// The engine cannot be reached: the state is unknown, and the sweep may go on.
    fn cancel(&self, folder: &ResultsFolder, tell: &dyn Tell) -> Result<Cancelled>;

    /// Does a task that the engine handed to another machine; its exit code.
    ///
    /// # Errors
    /// Files of the submission are damaged or do not appear.
    fn task(&self, _: &ResultsFolder, _: &Task, _say: &dyn Fn(&str)) -> Result<i32> {
        bail!("the engine {} has no tasks", self.name())
    }

    /// The jobs that a fit after a submission waits for.
    ///
    /// # Errors
    /// Files of the submission are damaged.
    fn fit_terms(&self, _: &ResultsFolder, _submission: Option<u32>) -> Result<FitTerms> {
        Ok(FitTerms::default())
    }
}

/// An engine that is about to work on a sweep.
pub trait Session {
    /// Queries the engine, once the folder is locked and before anything is written.
    ///
    /// # Errors
    /// The engine cannot be reached; nothing was changed.
    fn begin(&mut self) -> Result<()> {
        Ok(())
    }

    /// Runs jobs, each after its dependencies, or submits them.
    ///
    /// # Errors
    /// The engine cannot be used.
    fn bring(self: Box<Self>, jobs: Vec<Job>) -> Result<Brought>;

    /// Shows the submission, or whether it would be accepted; changes nothing.
    ///
    /// # Errors
    /// The engine has nothing to preview, or cannot be reached.
    fn preview(&mut self, _: Preview, _: Vec<Job>) -> Result<Previewed> {
        bail!("the engine hands nothing over, so there is nothing to preview")
    }
}

/// The result of running jobs.
pub enum Brought {
    /// They have ended.
    Ended(Vec<JobReport>),
    /// They end later, elsewhere, with a message about it.
    HandedOver { document: Value, text: String },
}

/// A request without a submission.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preview {
    /// Show the submission.
    DryRun,
    /// Whether it would be taken.
    Check,
}

/// The result of a preview.
pub struct Previewed {
    pub document: Value,
    pub text: String,
    /// Whether it would be accepted, if that was asked.
    pub taken: bool,
}

/// A task of a submission.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Task {
    pub submission: u32,
    pub array: String,
    pub index: usize,
}

/// The jobs that a fit waits for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FitTerms {
    /// Time for records of other machines to appear.
    pub grace: Duration,
    /// Whether laws are fitted although runs are missing.
    pub allow_missing: bool,
}

// [`SweepRequest`]: a request to an engine.

/// A request to an engine for a sweep.
#[derive(Clone, Copy)]
pub struct SweepRequest<'a> {
    /// As resolved.
    pub sweep: &'a Sweep,
    pub plan: &'a Plan,
    pub folder: &'a ResultsFolder,
    pub device: DeviceName,
    /// Jobs side by side on this machine.
    pub slots: usize,
    /// Memory for all jobs together; `None` for all available memory.
    pub memory_bytes: Option<u64>,
    /// Stop at the first failure.
    pub fail_fast: bool,
    /// A file of engine settings that override the sweep's.
    pub profile: Option<&'a Path>,
    /// The tracker that follows training, if one does.
    pub track: Option<Track>,
    pub tell: &'a dyn Tell,
}

/// Receives notes and warnings from an engine.
pub trait Tell {
    /// Something worth knowing.
    fn note(&self, line: &str);

    /// Something that may be wrong.
    fn warn(&self, line: &str);

    /// Whether progress is hidden.
    fn is_quiet(&self) -> bool;
}

// [`Track`]: which tracker follows training, as `--track` names it.

/// A tracker of experiments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Track {
    Tensorboard,
    Wandb,
    Mlflow,
}

impl Track {
    /// Each with a line for the help.
    pub const ALL: [(Self, &'static str); 3] = [
        (Self::Tensorboard, "Event files in results/NAME/tensorboard; for any trainer"),
        (Self::Wandb, "Weights & Biases; needs `trainer: torch`"),
        (Self::Mlflow, "MLflow; needs `trainer: torch`"),
    ];

    /// The name on the command line and for trainers.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tensorboard => "tensorboard",
            Self::Wandb => "wandb",
            Self::Mlflow => "mlflow",
        }
    }

    /// The variables that ask a trainer to track its run; empty if isoflop does it.
    pub fn variables(self, project: String) -> Vec<(&'static str, String)> {
        match self {
            Self::Tensorboard => Vec::new(),
            Self::Wandb | Self::Mlflow => {
                vec![("ISOFLOP_TRACK", self.name().to_string()), ("ISOFLOP_TRACK_PROJECT", project)]
            }
        }
    }
}
