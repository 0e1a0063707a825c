//! What `isoflop run` says of the jobs and runs that have no result.

use std::collections::HashMap;

use anyhow::Result;
use isoflop::engine::{JobEnd, JobReport};
use isoflop::failure::Failure;
use isoflop::jobs::{Job, all_jobs};
use isoflop::jobs::{JobId, JobState, ResultsFolder};
use isoflop::plan::Plan;

use super::args::RunArgs;
use crate::commands::command_line::CommandLine;
use crate::commands::exit::Exit;
use crate::commands::output::Output;

/// The last lines of a log that are shown.
const LAST_LINES: usize = 3;

/// What a summary is about.
pub struct Summary<'a> {
    pub plan: &'a Plan,
    pub folder: &'a ResultsFolder,
    pub reports: &'a [JobReport],
    pub command: CommandLine,
}

impl<'a> Summary<'a> {
    /// A summary of what a command has done.
    pub fn new(
        args: &RunArgs,
        plan: &'a Plan,
        folder: &'a ResultsFolder,
        reports: &'a [JobReport],
    ) -> Result<Self> {
        Ok(Self { plan, folder, reports, command: CommandLine::of(args)? })
    }

    /// Every failure, then every run without a record with its reason, and how to try again.
    pub fn tell(&self, output: &Output) -> Exit {
        self.failures(output);
        let done = |id: &str| self.folder.state(&JobId::run(id)) == JobState::Done;
        let lost: Vec<_> = self.plan.runs.iter().filter(|run| !done(&run.run_id)).collect();
        if lost.is_empty() {
            let failed = |job: Job| self.folder.state(&job.id) == JobState::Failed;
            let failed = all_jobs(self.plan).any(failed);
            return if failed { Exit::SomeRunsFailed } else { Exit::Done };
        }
        let needs = Needs::of(self.plan);
        for run in &lost {
            if let Some(reason) = self.reason(&run.run_id, &needs) {
                output.warn(&format!("{} has no result: {reason}", run.spec.label()));
            }
        }
        output.warn(&format!(
            "{} of {} runs have no result; to try them again: {}",
            lost.len(),
            self.plan.runs.len(),
            self.command.retry()
        ));
        Exit::SomeRunsFailed
    }

    /// Each job that failed, with its kind, reason, last lines, log and the command to rerun it.
    pub fn failures(&self, output: &Output) {
        for Job { id, label, .. } in all_jobs(self.plan) {
            if self.folder.state(&id) == JobState::Failed
                && let Ok(Some(failure)) = self.folder.failure(&id)
            {
                self.failure(&id, &label, &failure, output);
            }
        }
    }

    fn failure(&self, job: &JobId, label: &str, failure: &Failure, output: &Output) {
        let Failure { kind, reason, last_lines } = failure;
        output.warn(&format!("{label} failed [{}]: {reason}", kind.word()));
        for line in &last_lines[last_lines.len().saturating_sub(LAST_LINES)..] {
            output.warn(&format!("  | {line}"));
        }
        if let Some(advice) = kind.advice() {
            output.warn(&format!("  {advice}"));
        }
        output.warn(&format!("  see {}", self.folder.job(job).join("log.txt").display()));
        output.warn(&format!("  again: {}", self.command.retry_one(job)));
    }

    /// Why a run has no result whose failure was not told yet.
    fn reason(&self, id: &str, needs: &Needs) -> Option<String> {
        let run = JobId::run(id);
        if self.folder.state(&run) == JobState::Failed {
            return None;
        }
        for need in needs.all_of(&run) {
            if let Ok(Some(failure)) = self.folder.failure(&need) {
                return Some(format!("{} failed: {}", need.kind.role(), failure.reason));
            }
        }
        let report = self.reports.iter().find(|report| report.job.id == run);
        Some(match report.map(|report| &report.end) {
            Some(JobEnd::Stopped) => "it was stopped by the failure of another".to_string(),
            Some(JobEnd::Done) | None => "its record is missing".to_string(),
            Some(end) => end.failure().map(|failure| failure.reason.clone()).unwrap_or_default(),
        })
    }
}

/// What each job of a plan needs.
struct Needs(HashMap<JobId, Vec<JobId>>);

impl Needs {
    fn of(plan: &Plan) -> Self {
        Self(all_jobs(plan).map(|job| (job.id, job.needs)).collect())
    }

    /// What a job needs, and what those jobs need, nearest last.
    fn all_of(&self, job: &JobId) -> Vec<JobId> {
        let mut needs = Vec::new();
        let mut open: Vec<JobId> = self.0.get(job).cloned().unwrap_or_default();
        while let Some(need) = open.pop() {
            open.extend(self.0.get(&need).into_iter().flatten().cloned());
            needs.push(need);
        }
        needs.sort();
        needs
    }
}
