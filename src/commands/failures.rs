//! What `isoflop run` says of the runs that have no result.

use std::path::PathBuf;

use isoflop::plan::{Plan, RunSpec};
use isoflop::record::{JobState, ResultsFolder};
use isoflop::schedule::{JobEnd, JobReport};

use super::args::RunArgs;
use super::exit::Exit;
use super::output::Output;

/// Every run without a record, with its reason, and how to try again.
pub fn report(
    args: &RunArgs,
    plan: &Plan,
    folder: &ResultsFolder,
    reports: &[JobReport],
    output: &Output,
) -> Exit {
    let done = |id: &str| folder.run_state(id) == JobState::Done;
    let lost: Vec<_> = plan.runs.iter().filter(|run| !done(&run.run_id)).collect();
    if lost.is_empty() {
        return Exit::Done;
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
        retry(args)
    ));
    Exit::SomeRunsFailed
}

fn reason(id: &str, spec: &RunSpec, folder: &ResultsFolder, reports: &[JobReport]) -> String {
    let written = |place: PathBuf| Some(folder.failure(&place).ok()??.reason);
    if let Some(reason) = written(folder.run(id)) {
        return reason;
    }
    if let Some(reason) = written(folder.tokenizer(&spec.tokenizer_id)) {
        return format!("its tokenizer failed: {reason}");
    }
    let report = reports.iter().find(|report| report.job.kind.id() == id);
    match report.map(|report| &report.end) {
        Some(JobEnd::Failed(reason) | JobEnd::Crashed(reason)) => reason.clone(),
        Some(JobEnd::Stopped) => "it was stopped by the failure of another".to_string(),
        Some(JobEnd::Done) | None => "its record is missing".to_string(),
    }
}

/// The command as it was given, with `--retry-failed`.
fn retry(args: &RunArgs) -> String {
    let sweep = &args.sweep;
    let mut words = vec!["isoflop".to_string(), "run".to_string()];
    words.push(sweep.sweep.display().to_string());
    for setting in &sweep.settings {
        words.extend(["--set".to_string(), setting.clone()]);
    }
    words.extend(["--out".to_string(), sweep.out.display().to_string()]);
    words.extend(sweep.jobs.iter().flat_map(|n| ["--jobs".to_string(), n.to_string()]));
    words.extend(["--device".to_string(), sweep.device.name().to_string()]);
    words.push("--retry-failed".to_string());
    words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
}

/// A word as a POSIX shell reads it.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_string();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn words_are_quoted_where_a_shell_would_change_them() {
        assert_eq!(quoted("train.lr.max=1e-3"), "train.lr.max=1e-3");
        assert_eq!(quoted("grid.budgets=[1e9, 2e9]"), "'grid.budgets=[1e9, 2e9]'");
        assert_eq!(quoted("it's"), r"'it'\''s'");
    }
}
