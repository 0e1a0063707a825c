//! [`Queue`]: what Slurm says of our jobs, by one call of `squeue`.

use std::collections::HashMap;
use std::io;

use crate::engine::slurm::command::{QUERY, Shell};
use crate::engine::slurm::error::SlurmError;
use crate::engine::slurm::files::{ChunkFile, SlurmFolder};
use crate::engine::slurm::ledger::Entry;
use crate::engine::slurm::settings::Settings;
use crate::files::read_if_there;
use crate::jobs::JobId;

/// Base number, index, state, reason, nodes, comment. Not `--json`: that ignores `-u` and changes
/// from version to version.
const FORMAT: &str = "%F|%K|%T|%r|%N|%k";

/// How far a task is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TaskState {
    Waiting,
    Running,
    /// Between the two, or in a state that we have never heard of: not over, at any rate.
    Busy,
    Ended,
}

/// A task that Slurm still knows.
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

/// The tasks of a sweep that Slurm still knows. A task that ended minutes ago is not among them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Queue {
    pub tasks: Vec<QueuedTask>,
}

impl Queue {
    /// Asks Slurm for the jobs of some entries. Jobs are known by their tokens: numbers are given
    /// again when a controller is set up anew.
    ///
    /// # Errors
    /// Slurm gave no answer. Then nothing is known, least of all that nothing is there.
    pub fn ask(
        shell: &dyn Shell,
        settings: &Settings,
        entries: &[Entry],
    ) -> Result<Self, SlurmError> {
        let mut users: Vec<u32> = entries.iter().map(|entry| entry.user).collect();
        users.sort_unstable();
        users.dedup();
        if users.is_empty() {
            return Ok(Self::default());
        }
        let users = users.iter().map(u32::to_string).collect::<Vec<_>>().join(",");
        let asked = ["-h", "-r", "-t", "all", "-u", &users, "-o", FORMAT];
        let words = settings.program("squeue", &asked);
        let lines = shell.ask(&words, QUERY)?;
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
        let mut ids: Vec<String> = active.map(|task| task.job_id.clone()).collect();
        ids.sort();
        ids.dedup();
        ids
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
        // Slurm will put them back into the queue, where it may.
        "NODE_FAIL" | "PREEMPTED" if !requeue => TaskState::Ended,
        _ => TaskState::Busy,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
