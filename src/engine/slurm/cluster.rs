//! [`Cluster`]: a request to Slurm, with earlier submissions.

use super::command::{Settings, System};
use super::files::{Entry, Generation, Queue, QueuedTask, SlurmFolder, TaskState};
use super::submission::SubmissionTerms;
use crate::engine::{EngineState, SweepRequest};
use crate::files::read_if_there;
use crate::jobs::{JobId, JobKind, JobState, ResultsFolder, SweepState};
use anyhow::Result;
use serde::Serialize;
use serde_json::json;
use std::collections::{BTreeMap, HashMap};
use std::path::absolute;

use crate::words::wrap;

/// A request to be met by a cluster.
pub(super) struct Cluster<'a> {
    pub request: &'a SweepRequest<'a>,
    /// Named by its full path.
    pub folder: ResultsFolder,
    pub settings: Settings,
    /// Earlier submissions.
    pub entries: Vec<Entry>,
    pub queue: Queue,
    /// Jobs that are in the queue already, and their tasks.
    pub held: HashMap<JobId, String>,
    /// MaxArraySize, as Slurm says.
    pub asked: Option<usize>,
}

/// The settings and the ledger of a folder that a command looks into; `None` if nothing was ever
/// submitted from it.
pub fn of_folder(folder: &ResultsFolder) -> Result<Option<(Settings, Vec<Entry>)>> {
    let folder = ResultsFolder::new(absolute(folder.root())?);
    let files = SlurmFolder::of(&folder);
    let Some(generation) = files.latest()? else { return Ok(None) };
    let settings = settings_of(&files, Some(generation))?;
    Ok(Some((settings, files.entries()?)))
}

/// The settings of a submission; the defaults without one.
pub fn settings_of(files: &SlurmFolder, submission: Option<Generation>) -> Result<Settings> {
    let Some(generation) = submission else { return Ok(Settings::default()) };
    let written: Option<SubmissionTerms> = read_if_there(&files.written(generation))?;
    Ok(written.map(|written| written.settings).unwrap_or_default())
}

// Slurm's report on a sweep, in addition to the folder's.

/// Slurm's report in numbers.
#[derive(Clone, Debug, Default, Serialize)]
struct QueueState {
    /// Whether Slurm answered. Where it did not, nothing below is known.
    pub known: bool,
    /// Why it did not.
    pub error: Option<String>,
    /// Number of the last submission.
    pub submission: u32,
    pub tasks_running: usize,
    pub tasks_waiting: usize,
    /// Starting, completing, being put back into the queue.
    pub tasks_busy: usize,
    pub waiting: Vec<Waiting>,
    /// Runs that are missing and in no task: interrupted or lost.
    pub runs_lost: usize,
}

/// Tasks that wait for one reason.
#[derive(Clone, Debug, Serialize)]
struct Waiting {
    pub reason: String,
    /// In words.
    pub meaning: String,
    /// Whether they wait for ever.
    pub never: bool,
    pub tasks: usize,
    /// One of them, by the name that Slurm's programs take.
    pub example: String,
}

/// Asks Slurm once; `None` if the sweep was never submitted to it.
///
/// # Errors
/// Files of the submission cannot be read.
pub fn status(folder: &ResultsFolder, state: &SweepState) -> Result<Option<EngineState>> {
    let Some((settings, entries)) = of_folder(folder)? else { return Ok(None) };
    let files = SlurmFolder::of(folder);
    let submission = files.latest()?.unwrap_or(0);
    let told = match Queue::ask(&System, &settings, &entries) {
        Ok(queue) => {
            let open = |id| matches!(folder.state(id), JobState::Missing | JobState::Started);
            let held = queue.held(&entries, &files)?;
            let held = held.keys().filter(|id| id.kind == JobKind::Run && open(id)).count();
            let runs = &state.runs;
            let missing = runs.started + runs.missing + runs.running;
            let count = |state| queue.tasks.iter().filter(|task| task.state == state).count();
            QueueState {
                known: true,
                error: None,
                submission,
                tasks_running: count(TaskState::Running),
                tasks_waiting: count(TaskState::Waiting),
                tasks_busy: count(TaskState::Busy),
                waiting: waiting(&queue.tasks),
                runs_lost: missing.saturating_sub(runs.blocked + held),
            }
        }
        Err(error) => {
            QueueState { error: Some(error.to_string()), submission, ..QueueState::default() }
        }
    };
    let (document, text, wants_more) = (json!(told), told.text(), told.wants_more());
    Ok(Some(EngineState { document, text, wants_more }))
}

fn waiting(tasks: &[QueuedTask]) -> Vec<Waiting> {
    let mut reasons: BTreeMap<&str, Vec<&QueuedTask>> = BTreeMap::new();
    for task in tasks.iter().filter(|task| task.state == TaskState::Waiting) {
        reasons.entry(&task.reason).or_default().push(task);
    }
    let waiting = reasons.into_iter().map(|(reason, tasks)| {
        let (meaning, never) = outlook(reason);
        let (tasks, example) = (tasks.len(), tasks[0].name());
        Waiting { reason: reason.to_string(), meaning, never, tasks, example }
    });
    waiting.collect()
}

impl QueueState {
    /// Whether Slurm has something of the sweep that may still happen, or may have.
    pub fn is_active(&self) -> bool {
        !self.known || self.tasks_running + self.tasks_waiting + self.tasks_busy > 0
    }

    /// Whether runs are left that a new submission would take up.
    pub fn wants_more(&self) -> bool {
        self.known && (self.runs_lost > 0 || !self.is_active())
    }

    /// Lines for a person.
    pub fn text(&self) -> String {
        if let Some(error) = &self.error {
            return wrap("on Slurm: ", &format!("not known; {error}"));
        }
        if !self.is_active() {
            return "on Slurm: nothing in the queue\n".to_string();
        }
        let counts = [
            (self.tasks_running, "running"),
            (self.tasks_waiting, "waiting"),
            (self.tasks_busy, "on the way"),
        ];
        let counts = counts.into_iter().filter(|(count, _)| *count > 0);
        let counts: Vec<String> = counts.map(|(count, word)| format!("{count} {word}")).collect();
        let mut text = format!("on Slurm: tasks {}\n", counts.join(", "));
        text.extend(self.waiting.iter().map(Waiting::text));
        if self.runs_lost > 0 {
            let lost = format!("{} missing runs are in no task of Slurm's", self.runs_lost);
            text += &format!("{lost}: they were interrupted or lost\n");
        }
        text
    }
}

impl Waiting {
    fn text(&self) -> String {
        let Self { tasks, meaning, example, .. } = self;
        let who = match (self.never, tasks) {
            (true, _) => format!("{tasks} will never run (such as {example})"),
            (false, 1) => "1 waits".to_string(),
            (false, _) => format!("{tasks} wait"),
        };
        wrap("  ", &format!("{who}: {meaning}"))
    }
}

// Slurm's reasons, in words, and which of them will not pass.

/// The meaning of a reason from `squeue`, such as `Resources`: the end of the sentence "they wait: …", and whether the
/// task waits forever without intervention.
pub fn outlook(reason: &str) -> (String, bool) {
    let (words, never) = match reason {
        "None" | "" => ("Slurm has not looked at them yet", false),
        "Priority" => ("others come first", false),
        "Resources" => ("for free nodes", false),
        "Dependency" => ("for the jobs they depend on", false),
        "BeginTime" => ("for a moment after they were put back into the queue", false),
        "JobArrayTaskLimit" => ("as many run as array_parallel allows", false),
        "ReqNodeNotAvail" => ("for nodes that are down, drained or reserved", false),
        "NodeDown" => ("for a node that is down", false),
        "Reservation" => ("for their reservation to begin", false),
        "Licenses" => ("for licences", false),
        "DependencyNeverSatisfied" => ("for something that failed", true),
        "PartitionTimeLimit" => ("`time` is longer than the partition allows", true),
        "PartitionNodeLimit" => ("the partition has no such nodes", true),
        "PartitionConfig" => ("the partition cannot give what they ask for", true),
        "PartitionDown" => ("the partition is down", false),
        "PartitionInactive" => ("the partition is inactive", false),
        "BadConstraints" => ("no node has what they ask for", true),
        "InvalidAccount" => ("their account is not valid", true),
        "InvalidQOS" => ("their QOS is not valid", true),
        "AccountNotAllowed" => ("the account may not use this partition", true),
        "QOSNotAllowed" => ("the QOS may not be used in this partition", true),
        "JobHeldUser" | "JobHeldAdmin" => ("they are held; `scontrol release` lets them go", true),
        _ => return other(reason),
    };
    (words.to_string(), never)
}

/// Families of reasons; of the rest, Slurm's own word must do.
fn other(reason: &str) -> (String, bool) {
    let never = reason.contains("held") || reason.starts_with("launch_failed");
    let limit = ["QOSMax", "QOSGrp", "AssocMax", "AssocGrp", "MaxCpu", "MaxMem"];
    let words = if never {
        format!("they are held ({reason}); `scontrol release` lets them go")
    } else if limit.iter().any(|family| reason.starts_with(family)) {
        format!("a limit of the account or QOS is reached ({reason})")
    } else {
        reason.to_string()
    };
    (words, never)
}

#[cfg(test)]
mod tests {
    use super::outlook;

    #[test]
    fn reasons_that_do_not_pass_are_told_from_those_that_do() {
        for reason in ["DependencyNeverSatisfied", "PartitionTimeLimit", "JobHeldUser"] {
            assert!(outlook(reason).1, "{reason}");
        }
        assert!(outlook("launch failed requeued held").1);
        for reason in ["Priority", "QOSMaxJobsPerUserLimit", "SomethingNew"] {
            assert!(!outlook(reason).1, "{reason}");
        }
        assert_eq!(outlook("SomethingNew").0, "SomethingNew");
    }
}
