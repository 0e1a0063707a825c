//! Slurm's word on a sweep, beside the folder's.

use std::collections::BTreeMap;

use anyhow::Result;
use serde::Serialize;
use serde_json::json;

use super::cluster::of_folder;
use super::command::System;
use super::files::SlurmFolder;
use super::queue::{Queue, QueuedTask, TaskState};
use super::reasons::outlook;
use crate::engine::EngineState;
use crate::jobs::{JobKind, JobState, ResultsFolder, SweepState};
use crate::words::wrap;

/// What Slurm says, in numbers.
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

/// Asks Slurm once; `None` where the sweep was never submitted to it.
///
/// # Errors
/// Files of the submission cannot be read.
pub fn status(folder: &ResultsFolder, state: &SweepState) -> Result<Option<EngineState>> {
    let Some(queue) = look(folder, state)? else { return Ok(None) };
    let (document, text, wants_more) = (json!(queue), queue.text(), queue.wants_more());
    Ok(Some(EngineState { document, text, wants_more }))
}

fn look(folder: &ResultsFolder, state: &SweepState) -> Result<Option<QueueState>> {
    let Some((settings, entries)) = of_folder(folder)? else { return Ok(None) };
    let files = SlurmFolder::of(folder);
    let submission = files.latest()?.unwrap_or(0);
    let queue = match Queue::ask(&System, &settings, &entries) {
        Ok(queue) => queue,
        Err(error) => {
            let error = Some(error.to_string());
            return Ok(Some(QueueState { error, submission, ..QueueState::default() }));
        }
    };
    let open = |state| matches!(state, JobState::Missing | JobState::Started);
    let held = queue.held(&entries, &files)?;
    let held = held.keys().filter(|id| id.kind == JobKind::Run && open(folder.state(id))).count();
    let runs = &state.runs;
    let count = |state| queue.tasks.iter().filter(|task| task.state == state).count();
    Ok(Some(QueueState {
        known: true,
        error: None,
        submission,
        tasks_running: count(TaskState::Running),
        tasks_waiting: count(TaskState::Waiting),
        tasks_busy: count(TaskState::Busy),
        waiting: waiting(&queue.tasks),
        runs_lost: (runs.started + runs.missing + runs.running).saturating_sub(runs.blocked + held),
    }))
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
        text += &self.waiting.iter().map(Waiting::text).collect::<String>();
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
        let who = if *tasks == 1 { "1 waits".to_string() } else { format!("{tasks} wait") };
        match self.never {
            false => wrap("  ", &format!("{who}: {meaning}")),
            true => wrap("  ", &format!("{tasks} will never run (such as {example}): {meaning}")),
        }
    }
}
