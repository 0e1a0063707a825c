//! What would be submitted (`--dry-run`), and what Slurm says to it (`--check`).

use anyhow::{Context, Result};
use serde_json::json;

use super::check::{self, Verdict};
use super::command::Shell;
use super::packing::Packing;
use super::stages::{After, Array};
use crate::engine::contract::Previewed;
use crate::jobs::JobKind;
use crate::units::quoted;

/// What would be submitted if the queue were empty: scripts, and the calls with what Slurm and chance
/// will say left open.
///
/// # Errors
/// The jobs cannot be packed.
pub fn dry_run(packing: &Packing) -> Result<Previewed> {
    let submission = packing.preview()?;
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
    let document = json!({"jobs": packing.jobs.len(), "submissions": documents});
    Ok(Previewed { document, text, taken: true })
}

/// `: 2 tasks, 12 × run`.
fn counts(array: &Array) -> String {
    let jobs = || array.chunks.iter().flat_map(|chunk| &chunk.jobs);
    let of = |kind| jobs().filter(|timed| timed.job.id.kind == kind).count();
    let kinds = JobKind::all().map(|kind| (kind, of(kind))).filter(|(_, count)| *count > 0);
    let named: Vec<String> = kinds.map(|(kind, n)| format!("{n} × {}", kind.word())).collect();
    let waits = array.after.iter().any(|after| matches!(after, After::Queued(_)));
    let waits = if waits { ", after jobs in the queue" } else { "" };
    format!(": {} tasks, {}{waits}", array.chunks.len(), named.join(", "))
}

/// A call over several lines, as a shell reads it.
fn shown(words: &[String]) -> String {
    let words: Vec<String> = words.iter().map(|word| quoted(word)).collect();
    words.join(" \\\n  ")
}

/// Asks Slurm whether it would take each step if the queue were empty; changes nothing.
///
/// # Errors
/// Slurm gave no answer.
pub fn check(packing: &Packing, shell: &dyn Shell) -> Result<Previewed> {
    let submission = packing.preview()?;
    let verdicts = check::check(&submission, shell).context("asking Slurm")?;
    let line = |verdict: &Verdict| {
        let word = if verdict.taken { "taken" } else { "REFUSED" };
        format!("  {:<9} {word:<8} {}\n", verdict.name, verdict.said)
    };
    let taken = verdicts.iter().all(|verdict| verdict.taken);
    let end = match taken {
        true => "Slurm would take it; whether its nodes see this folder only a job can tell",
        false => "Slurm would not take it so; docs/cluster.md lists the keys of the profile",
    };
    let text = format!(
        "{}: nothing is submitted\n{}{end}",
        packing.cluster.request.sweep.name,
        verdicts.iter().map(line).collect::<String>()
    );
    Ok(Previewed { document: json!({"taken": taken, "steps": verdicts}), text, taken })
}
