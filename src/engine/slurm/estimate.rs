//! [`Estimates`]: how long jobs take, before they have been done.

use burn::tensor::Device;

use crate::files::FileError;
use crate::jobs::gpu::Gpu;
use crate::jobs::{Job, JobId, JobKind, JobState, ResultsFolder, probe};
use crate::plan::{Plan, PlannedRun};
use crate::record::flops_per_second;

/// Seconds of a job that does nothing: a process is started, and files are opened.
const START_S: f64 = 1.0;

/// Records that are read for the rate: as many tell it as well as all.
const SAMPLE: usize = 200;

/// One rate for all jobs, and where it comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimates {
    pub flops_per_second: f64,
    /// For a person: `as the section says`.
    pub source: &'static str,
}

impl Estimates {
    /// The rate that the section gives.
    pub fn given(flops_per_second: f64) -> Self {
        Self { flops_per_second, source: "as flops_per_second says" }
    }

    /// The rate of the finished runs of a folder; `None` where there is none.
    ///
    /// # Errors
    /// A record is damaged.
    pub fn of_records(plan: &Plan, folder: &ResultsFolder) -> Result<Option<Self>, FileError> {
        let done = |run: &&PlannedRun| folder.state(&JobId::run(&run.run_id)) == JobState::Done;
        let sample = plan.runs.iter().filter(done).take(SAMPLE);
        let records: Result<Vec<_>, FileError> =
            sample.map(|run| folder.record(&run.run_id)).collect();
        let source = "measured by finished runs";
        let rate = flops_per_second(records?.into_iter().flatten());
        Ok(rate.map(|flops_per_second| Self { flops_per_second, source }))
    }

    /// The rate of a few training steps on this machine.
    pub fn of_probe(plan: &Plan, device: &Device) -> Self {
        let jobs = JobKind::Run.jobs(plan);
        let flops: f64 = jobs.iter().map(|job| job.cost).sum();
        let seconds = 3600.0 * probe::speed_of(&jobs, plan, device, 1).hours(&jobs, plan, 1);
        let flops_per_second = if seconds > 0.0 { flops / seconds } else { f64::INFINITY };
        Self { flops_per_second, source: "measured here by a few steps" }
    }

    /// The mean rate of a plan's runs on a card.
    pub fn of_card(plan: &Plan, gpu: &Gpu) -> Self {
        let jobs = JobKind::Run.jobs(plan);
        let flops: f64 = jobs.iter().map(|job| job.cost).sum();
        let flops_per_second = flops / (3600.0 * gpu.hours(plan, &jobs));
        Self { flops_per_second, source: "by the MFU of engine.gpu" }
    }

    /// Seconds that a job takes on a slot of its own.
    pub fn seconds(&self, job: &Job) -> f64 {
        START_S + job.cost / self.flops_per_second
    }
}
