//! The summary of jobs and runs without a result.

use super::command_line::CommandLine;
use crate::commands::context::OpenSweep;
use crate::commands::prelude::*;
use isoflop::engine::{JobEnd, JobReport};
use isoflop::failure::Failure;
use isoflop::jobs::{Job, JobId, JobKind, JobState, all_jobs};
use isoflop::plan::PlannedRun;
use std::collections::HashMap;
use std::hash::Hash;

/// The last lines of a log that are shown.
const LAST_LINES: usize = 3;

/// The input of a summary.
pub struct Summary<'a> {
    pub open: &'a OpenSweep,
    pub reports: Vec<JobReport>,
    pub command: CommandLine,
}

impl Summary<'_> {
    fn state(&self, run: &PlannedRun) -> JobState {
        self.open.folder.state(&JobId::run(&run.run_id))
    }

    /// Whether a run of the plan is done.
    pub fn has_results(&self) -> bool {
        self.open.plan.runs.iter().any(|run| self.state(run) == JobState::Done)
    }

    /// Every failure, then every run without a record with its reason, and the command to retry.
    pub fn tell(&self, output: &Output) -> Exit {
        self.failures(output);
        let done = |run: &PlannedRun| self.state(run) == JobState::Done;
        let lost: Vec<_> = self.open.plan.runs.iter().filter(|run| !done(run)).collect();
        if lost.is_empty() {
            let failed = |job: Job| self.open.folder.state(&job.id) == JobState::Failed;
            let failed = all_jobs(&self.open.plan).any(failed);
            return if failed { Exit::SomeRunsFailed } else { Exit::Done };
        }
        let needs = all_jobs(&self.open.plan).map(|job| (job.id, job.needs)).collect();
        let reasons = lost.iter().filter_map(|run| {
            let is_begun = self.state(run) != JobState::Missing;
            Some(((is_begun, self.reason(&run.run_id, &needs)?), run.spec.label()))
        });
        for ((is_begun, reason), labels) in together(reasons) {
            let what = match (is_begun, labels.len()) {
                (true, 1) => "has no result",
                (true, _) => "have no result",
                (false, 1) => "was not started",
                (false, _) => "were not started",
            };
            output.warn(&format!("{} {what}: {reason}", several(&labels)));
        }
        output.warn(&format!(
            "{} of {} runs have no result ({}); to try them again: {}",
            lost.len(),
            self.open.plan.runs.len(),
            self.counts(&lost),
            self.command.said(None, &["--retry-failed"])
        ));
        Exit::SomeRunsFailed
    }

    /// `1 failed, 5 not started`: the states of the runs without a result.
    fn counts(&self, lost: &[&PlannedRun]) -> String {
        let count = |state| lost.iter().filter(|run| self.state(run) == state).count();
        let counts = [
            (count(JobState::Failed), "failed"),
            (count(JobState::Missing), "not started"),
            (count(JobState::Started), "begun and not finished"),
        ];
        let counts = counts.iter().filter(|(n, _)| *n > 0);
        counts.map(|(n, what)| format!("{n} {what}")).collect::<Vec<_>>().join(", ")
    }

    /// Each failed job with its kind, reason, last lines, log and the command to rerun it; jobs with the same reason are
    /// grouped under the first.
    pub fn failures(&self, output: &Output) {
        let failed = all_jobs(&self.open.plan).filter_map(|job| {
            let is_failed = self.open.folder.state(&job.id) == JobState::Failed;
            let failure = self.open.folder.failure(&job.id).ok().flatten().filter(|_| is_failed)?;
            Some(((failure.kind.word(), failure.reason.clone()), (job, failure)))
        });
        for (_, failed) in together(failed) {
            let labels: Vec<String> = failed.iter().map(|(job, _)| job.label.clone()).collect();
            let (job, failure) = &failed[0];
            let (id, Failure { kind, reason, last_lines }) = (&job.id, failure);
            output.warn(&format!("{} failed [{}]: {reason}", several(&labels), kind.word()));
            for line in &last_lines[last_lines.len().saturating_sub(LAST_LINES)..] {
                output.warn(&format!("  | {line}"));
            }
            if let Some(advice) = kind.advice() {
                output.warn(&format!("  {advice}"));
            }
            output.warn(&format!("  see {}", self.open.folder.job(id).join("log.txt").display()));
            output.warn(&format!("  again: {}", self.command.said(None, &["--retry", &id.id])));
        }
    }

    /// Why a run has no result, if no failure was reported.
    fn reason(&self, id: &str, needs: &HashMap<JobId, Vec<JobId>>) -> Option<String> {
        let run = JobId::run(id);
        if self.open.folder.state(&run) == JobState::Failed {
            return None;
        }
        for need in all_needs(needs, &run) {
            let Ok(Some(failure)) = self.open.folder.failure(&need) else { continue };
            if need.kind == JobKind::Run {
                return Some("the run that tries the trainer failed (trainer.canary)".to_string());
            }
            return Some(format!("{} failed: {}", need.kind.role(), failure.reason));
        }
        let report = self.reports.iter().find(|report| report.job.id == run);
        Some(match report.map(|report| &report.end) {
            Some(JobEnd::Stopped) => "the failure of another job stopped it".to_string(),
            Some(JobEnd::Done) | None => "its record is missing".to_string(),
            Some(end) => end.failure().map(|failure| failure.reason.clone()).unwrap_or_default(),
        })
    }
}

/// Groups values by a key, keeping the order of both.
fn together<K: Eq + Hash + Clone, V>(values: impl Iterator<Item = (K, V)>) -> Vec<(K, Vec<V>)> {
    let mut places: HashMap<K, usize> = HashMap::new();
    let mut groups: Vec<(K, Vec<V>)> = Vec::new();
    for (key, value) in values {
        let place = *places.entry(key.clone()).or_insert(groups.len());
        if place == groups.len() {
            groups.push((key, Vec::new()));
        }
        groups[place].1.push(value);
    }
    groups
}

/// The first of several names, and the number of others.
fn several(labels: &[String]) -> String {
    match labels {
        [] => String::new(),
        [one] => one.clone(),
        [first, more @ ..] => format!("{first} and {} more", more.len()),
    }
}

/// A job's dependencies, direct and indirect, in the order of their kinds.
fn all_needs(needs: &HashMap<JobId, Vec<JobId>>, job: &JobId) -> Vec<JobId> {
    let mut all = Vec::new();
    let mut open: Vec<JobId> = needs.get(job).cloned().unwrap_or_default();
    while let Some(need) = open.pop() {
        open.extend(needs.get(&need).into_iter().flatten().cloned());
        all.push(need);
    }
    all.sort();
    all
}
