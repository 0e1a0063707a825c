//! What `isoflop run` says of the runs that have no result.

use anyhow::Result;
use isoflop::plan::{Plan, RunSpec};
use isoflop::record::{JobId, JobKind, JobState, ResultsFolder};
use isoflop::schedule::{JobEnd, JobReport};

use super::args::RunArgs;
use super::command_line::CommandLine;
use super::exit::Exit;
use super::output::Output;

/// Every run without a record, with its reason, and how to try again.
pub fn report(
    args: &RunArgs,
    plan: &Plan,
    folder: &ResultsFolder,
    reports: &[JobReport],
    output: &Output,
) -> Result<Exit> {
    let done = |id: &str| folder.state(&JobId::run(id)) == JobState::Done;
    let lost: Vec<_> = plan.runs.iter().filter(|run| !done(&run.run_id)).collect();
    if lost.is_empty() {
        return Ok(Exit::Done);
    }
    for run in &lost {
        let reason = reason(&run.run_id, &run.spec, folder, reports);
        output.warn(&format!("{} has no result: {reason}", run.spec.label()));
        output.warn(&format!("  see {}", folder.run(&run.run_id).join("log.txt").display()));
    }
    output.warn(&format!(
        "{} of {} runs have no result; to try them again: {}",
        lost.len(),
        plan.runs.len(),
        CommandLine::of(args)?.retry()
    ));
    Ok(Exit::SomeRunsFailed)
}

fn reason(id: &str, spec: &RunSpec, folder: &ResultsFolder, reports: &[JobReport]) -> String {
    let run = JobId::run(id);
    let written = |job: &JobId| Some(folder.failure(job).ok()??.reason);
    if let Some(reason) = written(&run) {
        return reason;
    }
    for (need, name) in needs(spec) {
        if let Some(reason) = written(&need) {
            return format!("{name} failed: {reason}");
        }
    }
    let report = reports.iter().find(|report| report.job.id == run);
    match report.map(|report| &report.end) {
        Some(JobEnd::Failed(reason) | JobEnd::Crashed(reason)) => reason.clone(),
        Some(JobEnd::Stopped) => "it was stopped by the failure of another".to_string(),
        Some(JobEnd::Done) | None => "its record is missing".to_string(),
    }
}

/// What a run needs, with a name for a person.
fn needs(spec: &RunSpec) -> Vec<(JobId, &'static str)> {
    let RunSpec { tokenizer_id, text_id, .. } = spec;
    let trunk = spec.trunk().map(|trunk| (JobId::new(JobKind::Trunk, trunk.id()), "its trunk"));
    let data = [
        (JobId::new(JobKind::Text, text_id), "the embedding of captions"),
        (JobId::new(JobKind::Tokenizer, tokenizer_id), "its tokenizer"),
        (JobId::new(JobKind::Tokens, tokenizer_id), "tokenising"),
    ];
    data.into_iter().chain(trunk).collect()
}
