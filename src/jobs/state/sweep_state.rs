//! [`SweepState`]: how far a sweep is.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::failure::{Failure, FailureKind};
use crate::jobs::presence::Scheduler;
use crate::jobs::{JobId, JobKind};
use crate::progress::Beat;

/// Jobs by how far they are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    pub done: usize,
    pub failed: usize,
    /// A worker is at it now.
    pub running: usize,
    /// Interrupted, with a checkpoint to go on from.
    pub started: usize,
    pub missing: usize,
    /// Among the missing: jobs that need something that failed, which are not started.
    pub blocked: usize,
}

impl Counts {
    /// All of them.
    pub fn total(&self) -> usize {
        self.done + self.failed + self.running + self.started + self.missing
    }
}

/// A job that a worker is at.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Running {
    #[serde(flatten)]
    pub id: JobId,
    pub label: String,
    /// `None` before its first step.
    pub progress: Option<Beat>,
}

/// A job that failed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FailedJob {
    #[serde(flatten)]
    pub id: JobId,
    pub label: String,
    /// What went wrong; `kind` is the job's.
    #[serde(rename = "failure")]
    pub failure_kind: FailureKind,
    pub reason: String,
    pub last_lines: Vec<String>,
}

impl FailedJob {
    /// A failure with the name of its job.
    pub fn new(id: JobId, label: String, failure: Failure) -> Self {
        let Failure { kind: failure_kind, reason, last_lines } = failure;
        Self { id, label, failure_kind, reason, last_lines }
    }
}

/// How far a sweep is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SweepState {
    /// Whether a scheduler is at work on the folder.
    pub at_work: bool,
    /// Which one; unknown for a moment after its start.
    pub scheduler: Option<Scheduler>,
    /// What the runs need, by kind.
    pub inputs: BTreeMap<JobKind, Counts>,
    pub runs: Counts,
    pub running: Vec<Running>,
    pub failures: Vec<FailedJob>,
    /// FLOPs of all runs and trunks, and of those done with the part of those running.
    pub flops_total: f64,
    pub flops_done: f64,
    /// Seconds of work for one job at a time, by the rate of finished runs; what failed, and what
    /// waits for it, is left out.
    pub job_seconds_left: Option<f64>,
    /// Seconds to the end with as many jobs at work as now.
    pub eta_s: Option<f64>,
    /// Files that are damaged, and how to mend each.
    pub warnings: Vec<String>,
}
