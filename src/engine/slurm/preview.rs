//! What would be submitted (`--dry-run`), and what Slurm says to it (`--check`).

use anyhow::{Context, Result};
use serde_json::json;

use super::check::{self, Verdict};
use super::cluster::Cluster;
use super::command::Shell;
use super::packing::Packed;
use super::stages::{After, Array};
use crate::engine::contract::Previewed;
use crate::jobs::JobKind;
use crate::units::quoted;

/// What would be submitted if the queue were empty: scripts, and the calls with what Slurm and chance
/// will say left open.
///
/// # Errors
/// The jobs cannot be packed.
pub fn dry_run(cluster: &Cluster, packed: &Packed) -> Result<Previewed> {
    let submission = cluster.packed(packed)?;
    let steps = &submission.steps;
    let ids: Vec<String> = steps.iter().map(|step| format!("ID_OF_{}", step.name)).collect();
    let (mut text, mut documents) = (String::new(), Vec::new());
    for (at, step) in steps.iter().enumerate() {
        let words = submission.words(step, "TOKEN", &ids[..at]);
        let path = submission.files().script(submission.generation, &step.name);
        let (jobs, script) = (counts(step), submission.script(step));
        text += &format!("# {}{jobs}\n", step.name);
        text += &format!("{}\n\n# {}\n{script}\n", shown(&words), path.display());
        documents.push(json!({"name": step.name, "sbatch": words, "script": script}));
    }
    let document = json!({"jobs": packed.jobs.len(), "submissions": documents});
    Ok(Previewed { document, text, taken: true })
}

/// `: 2 tasks, 12 × run`; nothing of the fit.
fn counts(array: &Array) -> String {
    let Some(tasks) = array.tasks() else { return String::new() };
    let jobs = || array.chunks.iter().flat_map(|chunk| &chunk.jobs);
    let of = |kind| jobs().filter(|timed| timed.job.id.kind == kind).count();
    let kinds =
        JobKind::ALL.into_iter().map(|kind| (kind, of(kind))).filter(|(_, count)| *count > 0);
    let named: Vec<String> = kinds.map(|(kind, n)| format!("{n} × {}", kind.word())).collect();
    let waits = array.after.iter().any(|after| matches!(after, After::Queued(_)));
    let waits = if waits { ", after jobs in the queue" } else { "" };
    format!(": {tasks} tasks, {}{waits}", named.join(", "))
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
pub fn check(cluster: &Cluster, packed: &Packed, shell: &dyn Shell) -> Result<Previewed> {
    let submission = cluster.packed(packed)?;
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
        cluster.request.sweep.name,
        verdicts.iter().map(line).collect::<String>()
    );
    Ok(Previewed { document: json!({"taken": taken, "steps": verdicts}), text, taken })
}
