//! [`Guarded`]: starts no job that the task's time would not do for.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use crate::engine::local::LocalProcesses;
use crate::engine::slurm::files::ChunkFile;
use crate::engine::{JobEnd, Runner};
use crate::failure::Failure;
use crate::jobs::Job;
use crate::progress::{Beat, Stop};

/// Worker processes within a time limit.
pub struct Guarded<'a> {
    pub processes: LocalProcesses,
    /// When the task is over; `None` where it has no limit.
    pub end: Option<Instant>,
    /// How long each job takes.
    pub chunk: &'a ChunkFile,
    /// Whether a job ended since this task began. One that is longer than any limit must be begun
    /// all the same: it goes on from checkpoints, task after task.
    pub worked: AtomicBool,
    /// Raised when a job was not begun.
    pub out_of_time: &'a AtomicBool,
}

impl Guarded<'_> {
    fn is_too_late(&self, job: &Job) -> bool {
        let timed = self.chunk.jobs.iter().find(|timed| timed.job.id == job.id);
        let left = self.end.map(|end| end.saturating_duration_since(Instant::now()).as_secs_f64());
        let short = timed.zip(left).is_some_and(|(timed, left)| left < timed.seconds);
        short && self.worked.load(Ordering::SeqCst)
    }
}

impl Runner for Guarded<'_> {
    fn run(&self, job: &Job, stop: &Stop, beat: &mut dyn FnMut(Beat)) -> JobEnd {
        if self.is_too_late(job) {
            self.out_of_time.store(true, Ordering::SeqCst);
            stop.raise();
            return JobEnd::Stopped;
        }
        let end = self.processes.run(job, stop, beat);
        self.worked.fetch_or(end == JobEnd::Done, Ordering::SeqCst);
        end
    }

    fn give_up(&self, job: &Job, failure: Failure) -> Failure {
        self.processes.give_up(job, failure)
    }
}
