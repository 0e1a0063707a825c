//! The other side of a job: what a worker process does.

mod beats;
mod cause;
mod inputs;
mod mend;
mod peak;
mod record;
mod training;

use std::fs::{self, File, TryLockError};
use std::io::{self, Read};
use std::path::Path;
use std::time::Duration;

use anyhow::{Context, Result};
use burn::tensor::Device;

pub use beats::{Beat, Said, beats, forget_progress, note_progress, progress, tell_of_pieces};
pub use cause::failure_of;

use super::signals::Stop;
use crate::record::atomic::{remove_partial, write_json};
use crate::record::{Failure, JobId, JobKind, JobState, ResultsFolder, Verdict, read_if_there};
use crate::sweep::{self, Sweep};

/// Exit code of a worker whose job failed. It said why, and where it would fail again it wrote that
/// to `failure.json`.
pub const FAILED: i32 = 1;
/// Exit code of a worker that was asked to stop.
pub const STOPPED: i32 = 130;

/// How a job ended, seen from inside.
pub enum Outcome {
    Done,
    Stopped,
    Failed(Failure),
}

/// Time to reach the end of a step and write a checkpoint, once a stop is asked for.
pub const GRACE: Duration = Duration::from_secs(2);

/// Raises `stop` when standard input ends: the scheduler holds it open for as long as it lives.
///
/// Work that never looks at the flag, or takes too long to, is cut short: files are whole or not
/// there, so at most the steps since the last checkpoint are lost.
pub fn stop_with_parent(stop: &Stop, grace: Duration) {
    let stop = stop.clone();
    std::thread::spawn(move || {
        let _ = std::io::stdin().read_to_end(&mut Vec::new());
        stop.raise();
        std::thread::sleep(grace);
        std::process::exit(STOPPED);
    });
}

/// Waits until no other worker has this job, and keeps it from others for as long as it lives.
///
/// The worker of a scheduler that was killed may still be at its last step while the next
/// scheduler starts another one. `None` where a stop was asked for first.
pub fn claim(job: &Path, stop: &Stop) -> Result<Option<File>> {
    let path = job.join(".lock");
    let file = File::create(&path).with_context(|| format!("making {}", path.display()))?;
    while let Err(error) = file.try_lock() {
        match error {
            TryLockError::WouldBlock if stop.is_raised() => return Ok(None),
            TryLockError::WouldBlock => std::thread::sleep(Duration::from_millis(20)),
            TryLockError::Error(error) => {
                return Err(error).with_context(|| format!("locking {}", path.display()));
            }
        }
    }
    forget_progress(job);
    for folder in [job, &job.join("checkpoint")] {
        remove_partial(folder)?;
    }
    Ok(Some(file))
}

/// Lines of a log that a failure keeps.
const LAST_LINES: usize = 10;

/// The last lines of a job's log.
pub fn last_lines(job: &Path) -> Vec<String> {
    let log = fs::read(job.join("log.txt")).unwrap_or_default();
    let log = String::from_utf8_lossy(&log);
    let lines: Vec<String> = log.lines().map(String::from).collect();
    lines[lines.len().saturating_sub(LAST_LINES)..].to_vec()
}

/// Notes a failure in the job's folder: the job is not tried again unasked.
///
/// # Errors
/// The folder cannot be written to.
pub fn write_failure(job: &Path, failure: &Failure) -> io::Result<()> {
    write_json(&job.join("failure.json"), failure)
}

/// Tells the scheduler why the job in `place` has no result, and notes it there if it is final.
pub fn report_failure(place: &Path, failure: Failure) {
    let mut failure = Failure { last_lines: last_lines(place), ..failure };
    if failure.kind.verdict() == Verdict::Final
        && let Err(error) = write_failure(place, &failure)
    {
        // A full disk has many symptoms; this is the cause.
        failure = Failure { last_lines: failure.last_lines, ..cause::of_io(&error) };
    }
    Said::Failure(failure).say();
}

/// Does a job, unless it is done already.
pub fn work(
    folder: &ResultsFolder,
    job: &JobId,
    device: &Device,
    device_name: &str,
    stop: &Stop,
) -> Result<Outcome> {
    if folder.state(job) == JobState::Done {
        return Ok(Outcome::Done);
    }
    match job.kind {
        JobKind::Text => inputs::embed_text(folder, job),
        JobKind::Tokenizer => inputs::train_tokenizer(folder, job, device, stop),
        JobKind::Tokens => inputs::tokenize(folder, job, device, stop),
        JobKind::Trunk => training::train_trunk(folder, job, device, stop),
        JobKind::Run => training::train_run(folder, job, device, device_name, stop),
    }
}

/// What is finished needs none any more.
fn remove_checkpoint(place: &Path) -> io::Result<()> {
    let checkpoint = place.join("checkpoint");
    if checkpoint.exists() { fs::remove_dir_all(checkpoint) } else { Ok(()) }
}

/// The sweep as it was resolved when the folder was made.
pub(super) fn frozen_sweep(folder: &ResultsFolder) -> Result<Sweep> {
    Ok(sweep::read(&folder.file("sweep.yaml"), &[])?)
}

fn read<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T> {
    read_if_there(path)?.with_context(|| format!("{} is missing", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_belongs_to_one_worker_at_a_time() {
        let job = tempfile::tempdir().unwrap();
        let (running, stopped) = (Stop::default(), Stop::default());
        stopped.raise();
        let first = claim(job.path(), &running).unwrap();
        assert!(first.is_some());
        assert!(claim(job.path(), &stopped).unwrap().is_none());
        drop(first);
        assert!(claim(job.path(), &stopped).unwrap().is_some());
    }

    #[test]
    fn a_worker_clears_what_a_killed_one_left_half_written() {
        let job = tempfile::tempdir().unwrap();
        let checkpoint = job.path().join("checkpoint");
        fs::create_dir(&checkpoint).unwrap();
        fs::write(checkpoint.join("state.safetensors"), b"whole").unwrap();
        fs::write(checkpoint.join(".partial-a1b2c3"), b"hal").unwrap();
        let _lock = claim(job.path(), &Stop::default()).unwrap();
        let left: Vec<_> = fs::read_dir(&checkpoint).unwrap().collect();
        assert_eq!(left.len(), 1);
        assert!(checkpoint.join("state.safetensors").exists());
    }
}
