//! [`Runner`]: who does a single job, and how it ended.

use crate::failure::{Consequence, Failure};
use crate::jobs::Job;
use crate::progress::{Beat, Stop};

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
