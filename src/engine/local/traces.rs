//! Traces of jobs on disk: [`Timeline`], the time and slot of each as JSON lines in `schedule.jsonl`, and [`Curve`], its losses.

use crate::engine::runner::JobEnd;
use crate::files::FileError;
use crate::files::lines::read_lines;
use crate::files::tensorboard::{NAME, Scalar, header, records, restart};
use crate::jobs::speed::{SCHEDULE, Stretch};
use crate::jobs::{Job, ResultsFolder};
use crate::progress::{Beat, LogLine};
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::Path;
use std::sync::Mutex;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

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
        let session = fs::read_to_string(&path).map_or(0, |text| {
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

// The losses of a run in TensorBoard's event files, appended while it is trained.

/// The event files of a job: `tensorboard/<label>-<id>/`, a new one each time that the job is started.
pub struct Curve<'a> {
    folder: &'a ResultsFolder,
    job: &'a Job,
    file: Option<File>,
    /// Why nothing more is written.
    pub problem: Option<String>,
}

impl<'a> Curve<'a> {
    /// Begins a file with the first number that there is to write.
    pub fn new(folder: &'a ResultsFolder, job: &'a Job) -> Self {
        Self { folder, job, file: None, problem: None }
    }

    /// Writes the training loss of a step, and the tokens per second if given.
    pub fn beat(&mut self, beat: &Beat) {
        let mut scalars = vec![scalar("train/loss_nats", beat.step, beat.loss)];
        let speed = beat.tokens_per_s;
        scalars.extend(speed.map(|value| scalar("train/tokens_per_s", beat.step, value)));
        self.write(&scalars, Some(beat.step));
    }

    /// Writes the results of a finished run: the validation curve, and L_u on the test split.
    pub fn done(&mut self) {
        let lines = read_lines(&self.folder.job(&self.job.id).join("log.jsonl")).ok().flatten();
        let lines: Vec<LogLine> = lines.map(|lines| lines.whole).unwrap_or_default();
        let mut scalars: Vec<Scalar> = lines
            .iter()
            .map(|line| scalar("val/loss_normalised", line.step, line.val_loss_normalised))
            .collect();
        let last = scalars.last().map_or(0, |scalar| scalar.step);
        let record = self.folder.record(&self.job.id.id).ok().flatten();
        if let Some(Ok(loss)) = record.map(|record| record.loss_normalised()) {
            scalars.push(scalar("test/loss_normalised", last, loss));
        }
        self.write(&scalars, None);
    }

    /// Appends scalars; a new file then invalidates earlier entries from step `first` on.
    fn write(&mut self, scalars: &[Scalar], first: Option<usize>) {
        let place = self.folder.file("tensorboard").join(name(self.job));
        if !scalars.is_empty()
            && self.problem.is_none()
            && let Err(error) = self.append(&place, scalars, first)
        {
            self.problem = Some(format!("{}: {error}", place.display()));
        }
    }

    fn append(&mut self, place: &Path, scalars: &[Scalar], first: Option<usize>) -> io::Result<()> {
        let mut bytes = records(scalars);
        if self.file.is_none() {
            let restart = first.map(|step| restart(now_s(), step)).unwrap_or_default();
            bytes = [header(), restart, bytes].concat();
        }
        let file = match &mut self.file {
            Some(file) => file,
            none => none.insert(create(place)?),
        };
        // At once, so that a kill tears the last record at most.
        file.write_all(&bytes)
    }
}

/// The label with an id behind it, since labels say neither the generator nor all settings.
fn name(job: &Job) -> String {
    let id = &job.id.id;
    let word = |c: char| if c.is_alphanumeric() || "-.=".contains(c) { c } else { '-' };
    let label: String = job.label.chars().map(word).collect();
    format!("{label}-{}", &id[..id.len().min(6)])
}

/// A new file whose name sorts after existing ones, the order in which TensorBoard reads them.
fn create(place: &Path) -> io::Result<File> {
    fs::create_dir_all(place)?;
    let mut second = now_s() as u64;
    loop {
        match File::create_new(place.join(format!("{NAME}.{second:010}.isoflop"))) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => second += 1,
            ended => return ended,
        }
    }
}

fn scalar(tag: &'static str, step: usize, value: f64) -> Scalar {
    Scalar { tag, step, time_s: now_s(), value }
}

/// Seconds since 1970.
fn now_s() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |now| now.as_secs_f64())
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
