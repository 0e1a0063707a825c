//! A tokenizer that the trainer in PyTorch trains: `tokenizer: {trainer: torch}`.
//!
//! The worker writes the clips and the first weights into the checkpoint's folder and what is to be
//! trained into `trainer.json`, starts the trainer as it does that of a run, and takes the weights back.

use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf, absolute};

use anyhow::{Context, Result};
use serde::Deserialize;

use super::result::refusal;
use super::{of_torch, process, python};
use crate::failure::{Failure, FailureKind};
use crate::files::atomic::{remove, write_json};
use crate::files::read_if_there;
use crate::jobs::assignment::{Assignment, Outcome};
use crate::jobs::folder::CHECKPOINT;
use crate::spec::TokenizerJob;
use crate::tokenizer::{Corpus, Handover, HandoverFiles, Tokenizer, taken_back};

/// The module that trains tokenizers.
const MODULE: &str = "isoflop.torch.tokenizer";

/// What the trainer leaves: losses and times are for people.
#[derive(Deserialize)]
struct TokenizerResult {
    /// The weights, beside the result or by their whole path.
    weights: PathBuf,
}

/// Has the trainer in PyTorch train a tokenizer; `Break` if there is none, and how it ended.
///
/// # Errors
/// The clips or the first weights cannot be made or written, or the trainer's guard fails.
pub fn train_tokenizer(
    assignment: &Assignment,
    job: &TokenizerJob,
    corpus: &Corpus,
    text: Option<PathBuf>,
) -> Result<ControlFlow<Outcome, Tokenizer>> {
    let place = absolute(assignment.place()).context("naming the tokenizer's folder")?;
    let handover = handed_over(assignment, job, corpus, &place, text)?;
    let words = words(&place, &handover);
    let problem = process::attend(&words, &place, &assignment.job.id, assignment.stop)?;
    let trained = match problem {
        Some(problem) => Err(refusal(&handover.files.out).unwrap_or_else(|| of_torch(problem))),
        None => read(&handover, corpus, assignment),
    };
    Ok(match trained {
        Ok(tokenizer) => ControlFlow::Continue(tokenizer),
        Err(_) if assignment.stop.is_raised() => ControlFlow::Break(Outcome::Stopped),
        Err(failure) => ControlFlow::Break(Outcome::Failed(failure)),
    })
}

/// Writes all that the trainer reads.
fn handed_over(
    assignment: &Assignment,
    job: &TokenizerJob,
    corpus: &Corpus,
    place: &Path,
    text: Option<PathBuf>,
) -> Result<Handover> {
    let checkpoint = place.join(CHECKPOINT);
    fs::create_dir_all(&checkpoint).context("making the checkpoint's folder")?;
    let out = place.join("result.json");
    remove(&out)?;
    let files = HandoverFiles {
        out,
        checkpoint,
        text: text.map(absolute).transpose()?,
        checkpoint_s: assignment.sweep()?.train.checkpoint_s,
    };
    let handover = Handover::write(&job.spec, corpus, assignment.device, files)?;
    write_json(&place.join("trainer.json"), &handover).context("writing trainer.json")?;
    Ok(handover)
}

/// The trainer's command.
fn words(place: &Path, handover: &Handover) -> Vec<String> {
    let (python, spec) = (python(), place.join("trainer.json"));
    let path = |path: &Path| path.display().to_string();
    let options = [
        ("--spec", path(&spec)),
        ("--out", path(&handover.files.out)),
        ("--checkpoint", path(&handover.files.checkpoint)),
    ];
    let module = [path(&python), "-m".to_string(), MODULE.to_string()];
    let options = options.into_iter().flat_map(|(name, value)| [name.to_string(), value]);
    module.into_iter().chain(options).collect()
}

/// The tokenizer of the weights that the trainer has left.
fn read(
    handover: &Handover,
    corpus: &Corpus,
    assignment: &Assignment,
) -> Result<Tokenizer, Failure> {
    let out = &handover.files.out;
    let unfit = |problem: String| {
        let sentence = format!("the tokenizer's trainer: {}: {problem}", out.display());
        Failure::new(FailureKind::Trainer, sentence)
    };
    let result = read_if_there::<TokenizerResult>(out).map_err(|error| unfit(error.to_string()))?;
    let result =
        result.ok_or_else(|| unfit("it ended well but left no result here".to_string()))?;
    let path = out.with_file_name(result.weights);
    let tokenizer = taken_back(&handover.spec, corpus, assignment.device, &path);
    tokenizer.map_err(|error| unfit(format!("its weights {}: {error}", path.display())))
}
