//! [`SlurmFolder`]: the files of submissions in a sweep's folder, under `slurm`.

use super::command::{QUERY, Settings, Shell, SlurmError};
use crate::files::{atomic, read_if_there};
use crate::jobs::{Job, JobId, ResultsFolder};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeSet, HashMap};
use std::path::PathBuf;
use std::{fs, io};

/// The number of a submission, from 1.
pub type Generation = u32;

/// A job and how long it takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Timed {
    #[serde(flatten)]
    pub job: Job,
    /// Seconds, by the rate known when it was submitted.
    pub seconds: f64,
}

/// The jobs of a task; written once, never changed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChunkFile {
    /// Inputs from other tasks.
    pub needs: Vec<JobId>,
    /// The jobs, the most urgent first.
    pub jobs: Vec<Timed>,
}

/// The folder `slurm` of a sweep's folder:
///
/// ```text
/// bin/<digest>/isoflop          the program that tasks run
/// gen/<g>/submit.json           the request
/// gen/<g>/<array>.sh            the batch script of an array
/// gen/<g>/<array>/<i>.json      the chunk of a task
/// ledger/<g>-<array>.json       written before sbatch is called; the job's number after
/// logs/<g>-<array>-<job>_<i>.log
/// requeues/<g>-<array>-<i>/…    a file each time a task put itself back into the queue
/// ```
#[derive(Clone, Debug)]
pub struct SlurmFolder(PathBuf);

impl SlurmFolder {
    /// That of a sweep's folder; it need not exist.
    pub fn of(folder: &ResultsFolder) -> Self {
        Self(folder.file("slurm"))
    }

    /// The folder of a submission.
    fn generation(&self, generation: Generation) -> PathBuf {
        self.0.join("gen").join(generation.to_string())
    }

    /// The request of a submission.
    pub fn written(&self, generation: Generation) -> PathBuf {
        self.generation(generation).join("submit.json")
    }

    /// The batch script of an array.
    pub fn script(&self, generation: Generation, array: &str) -> PathBuf {
        self.generation(generation).join(format!("{array}.sh"))
    }

    /// The chunk of a task.
    pub fn chunk(&self, generation: Generation, array: &str, index: usize) -> PathBuf {
        self.generation(generation).join(array).join(format!("{index}.json"))
    }

    /// The folder of the logs: without it, no job of Slurm's would start.
    pub fn logs(&self) -> PathBuf {
        self.0.join("logs")
    }

    /// The folder of the ledger.
    fn ledger(&self) -> PathBuf {
        self.0.join("ledger")
    }

    /// The path of the program by digest.
    pub fn program(&self, digest: &str) -> PathBuf {
        self.0.join("bin").join(digest).join("isoflop")
    }

    /// The folder of a task's requeue notes.
    pub fn requeues(&self, generation: Generation, array: &str, index: usize) -> PathBuf {
        self.0.join("requeues").join(format!("{generation}-{array}-{index}"))
    }

    /// The number of the last submission; `None` if there was none.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub fn latest(&self) -> io::Result<Option<Generation>> {
        let folder = self.0.join("gen");
        if !folder.exists() {
            return Ok(None);
        }
        fs::read_dir(folder)?.try_fold(None, |latest: Option<Generation>, entry| {
            Ok(latest.max(entry?.file_name().to_str().and_then(|name| name.parse().ok())))
        })
    }
}

// The ledger: which jobs of Slurm's are ours, written so that a crash at any moment loses none.

/// One call of `sbatch`: the array, and the resulting job number.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Entry {
    pub generation: Generation,
    pub array: String,
    /// Random; the job carries it as its comment, so that it is found though its number is not known.
    pub token: String,
    /// The submitting user, by number.
    pub user: u32,
    /// Tasks of the array; `None` for a job that is no array.
    pub tasks: Option<usize>,
    /// The job's number; `None` before `sbatch` has said it.
    pub job_id: Option<String>,
    /// Taken back: never submitted, or cancelled since a later call failed.
    pub void: bool,
}

impl SlurmFolder {
    /// Every entry that was not taken back, in the order of submission.
    ///
    /// # Errors
    /// A file is damaged, or cannot be read.
    pub fn entries(&self) -> io::Result<Vec<Entry>> {
        if !self.ledger().exists() {
            return Ok(Vec::new());
        }
        let mut entries: Vec<Entry> = Vec::new();
        for file in fs::read_dir(self.ledger())? {
            let path = file?.path();
            if path.extension().is_some_and(|extension| extension == "json") {
                entries.extend(read_if_there::<Entry>(&path)?);
            }
        }
        entries.retain(|entry| !entry.void);
        let number = |entry: &Entry| entry.job_id.as_ref().and_then(|id| id.parse::<u64>().ok());
        entries.sort_by_key(|entry| (entry.generation, number(entry), entry.array.clone()));
        Ok(entries)
    }

    /// Writes an entry as it is now.
    ///
    /// # Errors
    /// The folder cannot be written to.
    pub fn write(&self, entry: &Entry) -> io::Result<()> {
        let name = format!("{}-{}.json", entry.generation, entry.array);
        Ok(atomic::write_json(&self.ledger().join(name), entry)?)
    }

    /// Takes an entry back.
    ///
    /// # Errors
    /// The folder cannot be written to.
    pub fn take_back(&self, entry: &Entry) -> io::Result<()> {
        self.write(&Entry { void: true, ..entry.clone() })
    }
}

/// A token that no other job has.
pub fn token() -> io::Result<String> {
    let random = tempfile::Builder::new().prefix("").rand_bytes(12).tempfile()?;
    let name = random.path().file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(format!("isoflop-{name}"))
}

// [`Queue`]: the state of our jobs, from one call of `squeue`.

/// Base number, index, state, reason, nodes, comment. Not `--json`: that ignores `-u` and changes
/// from version to version.
const FORMAT: &str = "%F|%K|%T|%r|%N|%k";

/// The state of a task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TaskState {
    Waiting,
    Running,
    /// Between the two, or in a state that we have never heard of: not over, at any rate.
    Busy,
    Ended,
}

/// A task known to Slurm.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct QueuedTask {
    pub job_id: String,
    /// `None` for a job that is no array.
    pub index: Option<usize>,
    pub state: TaskState,
    /// The state in Slurm's word.
    pub word: String,
    pub reason: String,
    pub token: String,
}

impl QueuedTask {
    /// Whether it may still do something.
    pub fn is_active(&self) -> bool {
        self.state != TaskState::Ended
    }

    /// The name that Slurm's programs take: `123_4`, or `123`.
    pub fn name(&self) -> String {
        match self.index {
            Some(index) => format!("{}_{index}", self.job_id),
            None => self.job_id.clone(),
        }
    }
}

/// The tasks of a sweep known to Slurm, without those that ended minutes ago.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Queue {
    pub tasks: Vec<QueuedTask>,
}

impl Queue {
    /// Asks Slurm for the jobs of some entries. Jobs are identified by their tokens: a reinstalled controller reuses
    /// numbers.
    ///
    /// # Errors
    /// Slurm gave no answer. Then the state is unknown; in particular, jobs may exist.
    pub fn ask(
        shell: &dyn Shell,
        settings: &Settings,
        entries: &[Entry],
    ) -> Result<Self, SlurmError> {
        let users: BTreeSet<u32> = entries.iter().map(|entry| entry.user).collect();
        if users.is_empty() {
            return Ok(Self::default());
        }
        let users = users.iter().map(u32::to_string).collect::<Vec<_>>().join(",");
        let asked = ["-h", "-r", "-t", "all", "-u", &users, "-o", FORMAT];
        let lines = shell.ask(&settings.program("squeue", &asked), QUERY)?;
        let ours = |task: &QueuedTask| entries.iter().any(|entry| entry.token == task.token);
        let tasks = lines.lines().filter_map(|line| parse(line, settings.requeue()));
        Ok(Self { tasks: tasks.filter(ours).collect() })
    }

    /// The tasks of an entry.
    pub fn of<'a>(&'a self, entry: &'a Entry) -> impl Iterator<Item = &'a QueuedTask> {
        self.tasks.iter().filter(|task| task.token == entry.token)
    }

    /// Whether anything may still happen.
    pub fn is_active(&self) -> bool {
        self.tasks.iter().any(QueuedTask::is_active)
    }

    /// Numbers of the jobs with anything active in them.
    pub fn active_jobs(&self) -> Vec<String> {
        let active = self.tasks.iter().filter(|task| task.is_active());
        let ids: BTreeSet<&String> = active.map(|task| &task.job_id).collect();
        ids.into_iter().cloned().collect()
    }

    /// The task that each job of an active chunk is in.
    ///
    /// # Errors
    /// A chunk's file is damaged or missing.
    pub fn held(
        &self,
        entries: &[Entry],
        folder: &SlurmFolder,
    ) -> io::Result<HashMap<JobId, String>> {
        let mut held = HashMap::new();
        for entry in entries {
            for task in self.of(entry).filter(|task| task.is_active()) {
                let Some(index) = task.index else { continue };
                let path = folder.chunk(entry.generation, &entry.array, index);
                let chunk: Option<ChunkFile> = read_if_there(&path)?;
                let jobs = chunk.into_iter().flat_map(|chunk| chunk.jobs);
                held.extend(jobs.map(|timed| (timed.job.id, task.name())));
            }
        }
        Ok(held)
    }
}

fn parse(line: &str, requeue: bool) -> Option<QueuedTask> {
    let fields: Vec<&str> = line.splitn(6, '|').map(str::trim).collect();
    let [job_id, index, state, reason, _, token] = fields[..] else { return None };
    let word = state.split_whitespace().next()?.to_string();
    Some(QueuedTask {
        job_id: job_id.to_string(),
        index: index.parse().ok(),
        state: state_of(&word, requeue),
        word,
        reason: reason.to_string(),
        token: token.to_string(),
    })
}

fn state_of(word: &str, requeue: bool) -> TaskState {
    match word {
        "PENDING" => TaskState::Waiting,
        "RUNNING" => TaskState::Running,
        "COMPLETED" | "CANCELLED" | "FAILED" | "TIMEOUT" | "OUT_OF_MEMORY" | "BOOT_FAIL"
        | "DEADLINE" | "REVOKED" => TaskState::Ended,
        // Slurm will requeue them, if allowed.
        "NODE_FAIL" | "PREEMPTED" if !requeue => TaskState::Ended,
        _ => TaskState::Busy,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::ResultsFolder;

    #[test]
    fn what_was_taken_back_is_not_ours_any_more() {
        let place = tempfile::tempdir().unwrap();
        let ledger = SlurmFolder::of(&ResultsFolder::new(place.path()));
        assert_eq!(ledger.entries().unwrap(), []);
        let entry = |array: &str, id: Option<&str>| Entry {
            generation: 1,
            array: array.to_string(),
            token: token().unwrap(),
            user: 0,
            tasks: Some(2),
            job_id: id.map(String::from),
            void: false,
        };
        let (first, second) = (entry("train", Some("9")), entry("fit", Some("10")));
        ledger.write(&second).unwrap();
        ledger.write(&first).unwrap();
        assert_ne!(first.token, second.token);
        assert_eq!(ledger.entries().unwrap(), [first.clone(), second.clone()]);
        ledger.take_back(&first).unwrap();
        assert_eq!(ledger.entries().unwrap(), [second]);
    }

    #[test]
    fn a_line_of_squeue_is_a_task() {
        let task = parse("12|3|CANCELLED by 0|None|n[1-2]|isoflop-a", true).unwrap();
        assert_eq!((task.name().as_str(), task.word.as_str()), ("12_3", "CANCELLED"));
        assert_eq!((task.state, task.token.as_str()), (TaskState::Ended, "isoflop-a"));
        let fit = parse("13|N/A|PENDING|Dependency||isoflop-b", true).unwrap();
        assert_eq!((fit.name().as_str(), fit.state), ("13", TaskState::Waiting));
        assert_eq!(parse("CLUSTER: alpha", true), None);
    }

    #[test]
    fn what_we_do_not_know_is_not_over() {
        assert_eq!(state_of("STAGE_OUT", true), TaskState::Busy);
        assert_eq!(state_of("NEW_IN_27_05", true), TaskState::Busy);
        assert_eq!(state_of("NODE_FAIL", true), TaskState::Busy);
        assert_eq!(state_of("NODE_FAIL", false), TaskState::Ended);
    }
}
