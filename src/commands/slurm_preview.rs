//! `isoflop run --engine slurm --dry-run` and `--check`: what would be submitted, and what Slurm says
//! to it.

use std::collections::HashMap;

use anyhow::{Context, Result, bail};
use isoflop::record::JobKind;
use isoflop::schedule::missing_jobs;
use isoflop::slurm::{self, After, Array, Settings, Shell};
use serde_json::json;

use super::args::RunArgs;
use super::command_line::CommandLine;
use super::context::OpenSweep;
use super::exit::Exit;
use super::output::Output;
use super::slurm::max_array;
use super::slurm_request::Request;

/// What would be submitted if the queue were empty: scripts, and the calls with what Slurm and chance
/// will say left open.
pub fn dry_run(
    args: &RunArgs,
    open: &OpenSweep,
    settings: Settings,
    output: &Output,
) -> Result<Exit> {
    let request = request(args, open, settings, None)?;
    let submission = request.preview(output)?;
    let steps = submission.steps();
    let ids: Vec<String> = steps.iter().map(|step| format!("ID_OF_{}", step.name)).collect();
    let (mut text, mut documents) = (String::new(), Vec::new());
    for (at, step) in steps.iter().enumerate() {
        let words = submission.words(at, step, "TOKEN", &ids[..at]);
        let path = submission.files().script(submission.generation, &step.name);
        let jobs = submission.arrays.get(at).map(counts);
        text += &format!("# {}{}\n", step.name, jobs.clone().unwrap_or_default());
        text += &format!("{}\n\n# {}\n{}\n", shown(&words), path.display(), step.script);
        documents.push(json!({"name": step.name, "sbatch": words, "script": step.script}));
    }
    let document = json!({"jobs": request.jobs.len(), "submissions": documents});
    output.result(&document, &text)?;
    Ok(Exit::Done)
}

/// `: 2 tasks, 12 runs`.
fn counts(array: &Array) -> String {
    let jobs = || array.chunks.iter().flat_map(|chunk| &chunk.jobs);
    let of = |kind| jobs().filter(|timed| timed.job.id.kind == kind).count();
    let kinds = JobKind::ALL.map(|kind| (kind, of(kind)));
    let kinds = kinds.iter().filter(|(_, count)| *count > 0);
    let named: Vec<String> = kinds.map(|(kind, n)| format!("{n} × {}", kind.word())).collect();
    let waits = array.after.iter().any(|after| matches!(after, After::Queued(_)));
    let waits = if waits { ", after jobs in the queue" } else { "" };
    format!(": {} tasks, {}{waits}", array.chunks.len(), named.join(", "))
}

/// A call over several lines, as a shell reads it.
fn shown(words: &[String]) -> String {
    let words: Vec<String> = words.iter().map(|word| CommandLine::quoted(word)).collect();
    words.join(" \\\n  ")
}

/// Asks Slurm whether it would take each step if the queue were empty; changes nothing.
pub fn check(
    args: &RunArgs,
    open: &OpenSweep,
    settings: Settings,
    shell: &dyn Shell,
    output: &Output,
) -> Result<Exit> {
    let asked = max_array(&settings, shell)?;
    let submission = request(args, open, settings, asked)?.preview(output)?;
    let verdicts = slurm::check(&submission, shell).context("asking Slurm")?;
    let line = |verdict: &slurm::Verdict| {
        let word = if verdict.taken { "taken" } else { "REFUSED" };
        format!("  {:<9} {word:<8} {}\n", verdict.name, verdict.said)
    };
    let all = verdicts.iter().all(|verdict| verdict.taken);
    let end = match all {
        true => "Slurm would take it; whether its nodes see this folder only a job can tell",
        false => "Slurm would not take it so; docs/cluster.md lists the keys of the profile",
    };
    let text = format!(
        "{}: nothing is submitted\n{}{end}",
        open.sweep.name,
        verdicts.iter().map(line).collect::<String>()
    );
    output.result(&json!({"taken": all, "steps": verdicts}), &text)?;
    Ok(if all { Exit::Done } else { Exit::Usage })
}

/// All that is missing, as if nothing were in the queue.
fn request<'a>(
    args: &'a RunArgs,
    open: &'a OpenSweep,
    settings: Settings,
    asked: Option<usize>,
) -> Result<Request<'a>> {
    let jobs = missing_jobs(&open.plan, &open.folder);
    if jobs.is_empty() {
        bail!("nothing is missing, so there is nothing to submit");
    }
    let (queued, active) = (HashMap::new(), Vec::new());
    Ok(Request { args, open, settings, jobs, queued, active, asked })
}
