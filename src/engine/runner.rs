//! [`Runner`]: who does a single job, and how it ended.

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
    /// It would end so again; the reason is in its folder too.
    Failed(Failure),
    /// It was asked to stop, and goes on from its checkpoint another time.
    Stopped,
    /// Its process died or was killed: may pass.
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

    /// `done`, `stopped`, or the kind of what went wrong.
    pub fn word(&self) -> &'static str {
        match (self, self.failure()) {
            (_, Some(failure)) => failure.kind.word(),
            (Self::Done, None) => "done",
            (_, None) => "stopped",
        }
    }

    /// What went wrong, where something did.
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
    /// Does a job to its end; `beat` is told how far it is.
    fn run(&self, job: &Job, stop: &Stop, beat: &mut dyn FnMut(Beat)) -> JobEnd;

    /// Notes for good that a job failed which died too often; returns the failure as noted.
    fn give_up(&self, _: &Job, failure: Failure) -> Failure {
        failure
    }
}

// What an engine says of a sweep.

/// What an engine says of a sweep, beside the sweep's folder.
#[derive(Clone, Debug, PartialEq)]
pub struct EngineState {
    /// For `--json`.
    pub document: Value,
    /// For a person.
    pub text: String,
    /// Whether runs are left that a new submission would hand over.
    pub wants_more: bool,
}

/// What became of a wish to end, from the least to the worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cancelled {
    NothingRan,
    /// Everything ended within the time given to it.
    Ended,
    /// Something had to be killed; it goes on from its last checkpoint.
    Killed,
    StillAtWork,
}

// [`Engine`] and [`Session`]: what commands ask of an engine, and what it answers.

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

    /// What the engine says of a sweep, beside the sweep's folder; `None` if it has nothing of it.
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

// [`SweepRequest`]: what is asked of an engine for a sweep.

/// What is asked of an engine for a sweep.
#[derive(Clone, Copy)]
pub struct SweepRequest<'a> {
    /// As resolved.
    pub sweep: &'a Sweep,
    pub plan: &'a Plan,
    pub folder: &'a ResultsFolder,
    pub device: DeviceName,
    /// Jobs side by side on this machine.
    pub slots: usize,
    /// Memory for all jobs together; `None`: what is available.
    pub memory_bytes: Option<u64>,
    /// Stop at the first failure.
    pub fail_fast: bool,
    /// A file with keys of the engine's section, laid over those of the sweep.
    pub profile: Option<&'a Path>,
    /// The tracker that follows training, if one does.
    pub track: Option<Track>,
    pub tell: &'a dyn Tell,
}

/// Whom an engine tells what is no result.
pub trait Tell {
    /// Something worth knowing.
    fn note(&self, line: &str);

    /// Something that may be wrong.
    fn warn(&self, line: &str);

    /// Whether nobody wants to see progress.
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

    /// The variables by which a trainer knows that it is to track its run; empty if isoflop itself does.
    pub fn variables(self, project: String) -> Vec<(&'static str, String)> {
        match self {
            Self::Tensorboard => Vec::new(),
            Self::Wandb | Self::Mlflow => {
                vec![("ISOFLOP_TRACK", self.name().to_string()), ("ISOFLOP_TRACK_PROJECT", project)]
            }
        }
    }
}
