//! Locks a folder: a lock that ends with its process, a note about the owner, and a file by which any user with write
//! access asks for an end.

use std::fs::{self, File, TryLockError};
use std::path::Path;
use std::time::Duration;

use anyhow::{Context, Result as AnyResult};
use serde::{Deserialize, Serialize};

use super::folder::{CHECKPOINT, ResultsFolder};
use crate::files::{FileError, atomic, read_if_there};
use crate::progress::{Stop, forget_progress};

const LOCK: &str = ".lock";
const SCHEDULER: &str = ".scheduler.json";
const CANCEL: &str = ".cancel";

/// Time between checks for a request to end.
const LOOK: Duration = Duration::from_millis(500);

/// The process that schedules a sweep.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Scheduler {
    /// Its process id, on its host.
    pub pid: u32,
    pub host: String,
}

impl Scheduler {
    /// This process.
    pub fn this() -> Self {
        Self { pid: std::process::id(), host: host() }
    }
}

/// A folder that is this process's alone, until it is dropped.
#[derive(Debug)]
pub struct Held {
    folder: ResultsFolder,
    /// Released when the process ends, however it ends.
    _lock: File,
}

impl Held {
    /// Locks the folder; if another process has it, calls `waiting` once and waits.
    ///
    /// Requests to an earlier scheduler are dropped. Requests made while this process waited are kept: they address every
    /// process that wanted the folder then.
    ///
    /// # Errors
    /// The folder cannot be written to.
    pub fn take(folder: &ResultsFolder, waiting: impl FnOnce()) -> Result<Self, FileError> {
        let path = folder.file(LOCK);
        let refused = FileError::write(&path);
        fs::create_dir_all(folder.root()).map_err(&refused)?;
        let lock = File::create(&path).map_err(&refused)?;
        match try_twice(&lock) {
            Ok(()) => atomic::remove(&folder.file(CANCEL))?,
            Err(TryLockError::WouldBlock) => {
                waiting();
                lock.lock().map_err(&refused)?;
            }
            Err(TryLockError::Error(error)) => return Err(refused(error)),
        }
        atomic::write_json(&folder.file(SCHEDULER), &Scheduler::this())?;
        Ok(Self { folder: folder.clone(), _lock: lock })
    }
}

/// Raises `stop` when an end is requested by [`ask_to_end`].
pub fn stop_when_asked(folder: &ResultsFolder, stop: &Stop) {
    let (path, stop) = (folder.file(CANCEL), stop.clone());
    std::thread::spawn(move || {
        while !stop.is_raised() {
            if path.exists() {
                stop.raise();
            }
            std::thread::sleep(LOOK);
        }
    });
}

impl Drop for Held {
    fn drop(&mut self) {
        let _ = fs::remove_file(self.folder.file(SCHEDULER));
    }
}

/// Tries to lock; once more after a moment, since a look by [`is_locked`] has the lock for one.
fn try_twice(lock: &File) -> Result<(), TryLockError> {
    match lock.try_lock() {
        Err(TryLockError::WouldBlock) => {
            std::thread::sleep(Duration::from_millis(20));
            lock.try_lock()
        }
        tried => tried,
    }
}

/// Waits until no other worker has this job, and keeps it from others for as long as it lives.
///
/// The worker of a scheduler that was killed may still be at its last step while the next
/// scheduler starts another one. `None` if a stop was asked for first.
pub fn claim(job: &Path, stop: &Stop) -> AnyResult<Option<File>> {
    let path = job.join(LOCK);
    let file = File::create(&path).map_err(FileError::write(&path))?;
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
    for folder in [job, &job.join(CHECKPOINT)] {
        atomic::remove_partial(folder)?;
    }
    Ok(Some(file))
}

/// Whether a scheduler has the folder.
pub fn is_held(folder: &ResultsFolder) -> bool {
    is_locked(folder.root())
}

/// Whether a living process holds the lock of a folder: a scheduler's or a worker's.
///
/// The lock of a dead process is released, so no clock is needed.
pub fn is_locked(place: &Path) -> bool {
    let Ok(lock) = File::open(place.join(LOCK)) else { return false };
    matches!(lock.try_lock_shared(), Err(TryLockError::WouldBlock))
}

/// The owner of the folder; `None` if there is none, or it has not written its note yet.
pub fn scheduler(folder: &ResultsFolder) -> Option<Scheduler> {
    let noted = read_if_there(&folder.file(SCHEDULER)).ok().flatten();
    noted.filter(|_| is_held(folder))
}

/// Asks the owner of the folder to end as for Ctrl-C, on this machine or another.
///
/// # Errors
/// The folder cannot be written to.
pub fn ask_to_end(folder: &ResultsFolder) -> Result<(), FileError> {
    let path = folder.file(CANCEL);
    if path.exists() { Ok(()) } else { atomic::write_json(&path, &Scheduler::this()) }
}

/// Whether an end was requested by [`ask_to_end`].
pub fn is_asked_to_end(folder: &ResultsFolder) -> bool {
    folder.file(CANCEL).exists()
}

/// Withdraws the request of [`ask_to_end`].
///
/// # Errors
/// The folder cannot be written to.
pub fn ask_no_more(folder: &ResultsFolder) -> Result<(), FileError> {
    atomic::remove(&folder.file(CANCEL))
}

fn host() -> String {
    let files = ["/proc/sys/kernel/hostname", "/etc/hostname"];
    let noted = files.iter().find_map(|path| fs::read_to_string(path).ok());
    let named = noted.or_else(|| std::env::var("HOSTNAME").ok()).unwrap_or_default();
    let name = named.trim();
    if name.is_empty() { "this machine".to_string() } else { name.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_held_for_as_long_as_its_holder_lives() {
        let place = tempfile::tempdir().unwrap();
        let folder = ResultsFolder::new(place.path());
        assert!(!is_held(&folder));
        let held = Held::take(&folder, || panic!("nobody has it")).unwrap();
        assert_eq!(scheduler(&folder), Some(Scheduler::this()));
        drop(held);
        assert!(!is_held(&folder));
        assert_eq!(scheduler(&folder), None);
        assert!(!folder.file(SCHEDULER).exists());
    }

    #[test]
    fn what_a_killed_scheduler_noted_is_not_believed() {
        let place = tempfile::tempdir().unwrap();
        let folder = ResultsFolder::new(place.path());
        fs::write(folder.file(LOCK), "").unwrap();
        atomic::write_json(&folder.file(SCHEDULER), &Scheduler::this()).unwrap();
        assert_eq!(scheduler(&folder), None);
    }

    #[test]
    fn an_end_asked_of_an_earlier_scheduler_does_not_reach_the_next() {
        let place = tempfile::tempdir().unwrap();
        let folder = ResultsFolder::new(place.path());
        ask_to_end(&folder).unwrap();
        let _held = Held::take(&folder, || ()).unwrap();
        assert!(!folder.file(CANCEL).exists());
    }

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
        let checkpoint = job.path().join(CHECKPOINT);
        fs::create_dir(&checkpoint).unwrap();
        fs::write(checkpoint.join("state.safetensors"), b"whole").unwrap();
        fs::write(checkpoint.join(".partial-a1b2c3"), b"hal").unwrap();
        let _lock = claim(job.path(), &Stop::default()).unwrap();
        let left: Vec<_> = fs::read_dir(&checkpoint).unwrap().collect();
        assert_eq!(left.len(), 1);
        assert!(checkpoint.join("state.safetensors").exists());
    }
}
