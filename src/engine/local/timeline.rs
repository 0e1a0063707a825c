//! [`Timeline`]: the time and slot of each job, as JSON lines in `schedule.jsonl`.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::sync::Mutex;
use std::time::Instant;

use crate::engine::runner::JobEnd;
use crate::files::FileError;
use crate::jobs::history::{SCHEDULE, Stretch};
use crate::jobs::{Job, ResultsFolder};

/// The times of a scheduler's jobs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spent {
    /// Seconds from the scheduler's beginning to the last end of a job.
    pub span_s: f64,
    /// Core-seconds in training steps.
    pub train_s: f64,
}

impl Spent {
    /// The share of `slots` cores' time that went into training steps.
    pub fn training_share(&self, slots: usize) -> f64 {
        self.train_s / (slots as f64 * self.span_s)
    }
}

/// The record of job times of a scheduler.
pub struct Timeline {
    written: Mutex<(File, Spent)>,
    session: usize,
    began: Instant,
}

impl Timeline {
    /// Goes on with the folder's file.
    ///
    /// # Errors
    /// The folder cannot be written to.
    pub fn open(folder: &ResultsFolder) -> Result<Self, FileError> {
        let path = folder.file(SCHEDULE);
        let session = std::fs::read_to_string(&path).map_or(0, |text| {
            let last = text.lines().rev().find_map(|line| serde_json::from_str(line).ok());
            last.map_or(0, |last: Stretch| last.session + 1)
        });
        let file = OpenOptions::new().create(true).append(true).open(&path);
        let written = Mutex::new((file.map_err(FileError::write(&path))?, Spent::default()));
        Ok(Self { written, session, began: Instant::now() })
    }

    /// Seconds since it was opened.
    pub fn now_s(&self) -> f64 {
        self.began.elapsed().as_secs_f64()
    }

    /// Records a job that started at `start_s` and ended now. A line that cannot be written is dropped: nothing depends
    /// on it, and the same cause affects the job too.
    pub fn note(&self, job: &Job, slot: usize, [start_s, train_s]: [f64; 2], end: &JobEnd) {
        let stretch = Stretch {
            session: self.session,
            id: job.id.clone(),
            label: job.label.clone(),
            slot,
            start_s,
            end_s: self.now_s(),
            train_s,
            end: end.word().to_string(),
        };
        let line = serde_json::to_string(&stretch).expect("plain values") + "\n";
        let mut written = self.written.lock().expect("nothing panics while it holds this");
        let (file, spent) = &mut *written;
        let _ = file.write_all(line.as_bytes());
        spent.span_s = spent.span_s.max(stretch.end_s);
        spent.train_s += train_s;
    }

    /// The use of time so far.
    pub fn spent(&self) -> Spent {
        self.written.lock().expect("nothing panics while it holds this").1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_idle_core_trains_nothing() {
        let spent = Spent { span_s: 10.0, train_s: 9.0 };
        assert_eq!(spent.training_share(2), 0.45);
    }
}
