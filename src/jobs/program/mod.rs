//! Training by other programs: runs by a user's trainer, `trainer: {command: …}`, and tokenizers by PyTorch,
//! `tokenizer: {trainer: torch}`.
//!
//! The worker writes the specification (`trainer.json`), starts the program with a guard that outlives the worker,
//! forwards its progress, and checks its result (`result.json`).

mod process;
mod result;
mod spec;

pub use process::{GRACE, guard, wake_guard};
pub use result::{FinishedRun, TrainerResult};
pub use spec::TrainerSpec;

use std::collections::BTreeMap;
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf, absolute};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use serde::Deserialize;

use super::assignment::{Assignment, Outcome};
use super::assignment::{LOG, MODEL, TEST_CLIPS, weights_notes};
use super::folder::{CHECKPOINT, ResultsFolder};
use super::job::{JobId, JobKind};
use super::worker;
use crate::codes::TokenStore;
use crate::failure::{Failure, FailureKind};
use crate::files::atomic::{remove, write_json, write_json_lines, write_plain_json};
use crate::files::read_if_there;
use crate::generator;
use crate::learn::weights::{self, Source};
use crate::spec::{RunSpec, TokenizerJob, TrainerProgram, is_torch};
use crate::sweep::TrainerCommand;
use crate::tokenizer::{Corpus, Handover, HandoverFiles, Tokenizer, taken_back};
use result::refusal;

/// Time for a worker to end after a stop request: longer than for its program.
pub fn grace(folder: &ResultsFolder, job: &JobId) -> Duration {
    let of_run = |spec: RunSpec| spec.trainer.is_some();
    let of_tokenizer = |job: TokenizerJob| !job.spec.trainer.is_built_in();
    let has_program = match job.kind {
        JobKind::Run => folder.known_spec(job).is_some_and(of_run),
        JobKind::Tokenizer => folder.known_spec(job).is_some_and(of_tokenizer),
        _ => false,
    };
    if has_program { GRACE + 2 * worker::GRACE } else { worker::GRACE }
}

/// Trains a run by a program, and writes the record from its result.
pub fn run_program(
    assignment: &Assignment,
    run: &RunSpec,
    trainer: &TrainerProgram,
) -> Result<Outcome> {
    let Assignment { folder, stop, job, .. } = *assignment;
    let id = job.id.as_str();
    let command = TrainerCommand::parse(&trainer.command)?;
    let place = absolute(folder.run(id)).context("naming the run's folder")?;
    let codes = folder.tokens(&run.tokenizer_id);
    let tokens = codes.exists().then(|| TokenStore::open(&codes)).transpose()?;
    let spec = TrainerSpec::new(folder, id, run, tokens.as_ref())?;
    let spec = with_init(spec, &command, run, assignment)?;
    let words = prepare(&spec, &command, &place)?;
    let started = Instant::now();
    let problem = process::attend(&words, &place, id, stop)?;
    let ran_s = started.elapsed().as_secs_f64();
    let unfit = |problem| Failure::new(FailureKind::Trainer, problem);
    let result = match problem {
        Some(problem) => Err(refusal(&spec.out).unwrap_or_else(|| {
            if is_torch(&trainer.command) { of_torch(problem) } else { problem }
        })),
        None => TrainerResult::read(&spec.out)
            .and_then(|result| result.fits(tokens.as_ref()).map(|()| result))
            .map_err(unfit),
    };
    let kept = result.and_then(|result| {
        keep_weights(&result, &place, run, assignment).map(|()| result).map_err(unfit)
    });
    match kept {
        Ok(result) => {
            if !result.log.is_empty() {
                write_json_lines(&place.join(LOG), &result.log)?;
            }
            if !result.clips.is_empty() {
                write_json_lines(&place.join(TEST_CLIPS), &result.clips)?;
            }
            let (tokens, max_text_tokens) = (tokens.as_ref(), spec.max_text_tokens);
            let run = FinishedRun { folder, id, spec: run, tokens, max_text_tokens, ran_s };
            let record = run.record(&result);
            write_json(&place.join("record.json"), &record).context("writing record.json")?;
            tidy(&spec);
            Ok(Outcome::Done)
        }
        Err(_) if stop.is_raised() => Ok(Outcome::Stopped),
        Err(failure) => Ok(Outcome::Failed(failure)),
    }
}

/// Removes what a finished run needs no more. The program may have removed it, and the run is done either way.
#[expect(clippy::print_stderr, reason = "what a worker writes there is the log of its job")]
fn tidy(spec: &TrainerSpec) {
    let removed = fs::remove_dir_all(&spec.checkpoint);
    let removed = removed.map_err(|error| format!("{}: {error}", spec.checkpoint.display()));
    let left = removed.err().filter(|_| spec.checkpoint.exists());
    let init = spec.init.iter().filter_map(|init| Some(remove(init).err()?.to_string()));
    for reason in left.into_iter().chain(init) {
        eprintln!("warning: the run is done, and a file that it needs no more is left: {reason}");
    }
}

/// Writes the weights that the built-in trainer would begin with, where the command asks for them.
fn with_init(
    spec: TrainerSpec,
    command: &TrainerCommand,
    run: &RunSpec,
    assignment: &Assignment,
) -> Result<TrainerSpec> {
    if !command.asks_for("init") {
        return Ok(spec);
    }
    let path = spec.out.with_file_name("init.safetensors");
    if !path.exists() {
        let first = generator::of(run).first_weights(run, assignment.device);
        weights::save(&path, &first, BTreeMap::new())?;
    }
    Ok(TrainerSpec { init: Some(path), ..spec })
}

/// Makes the folder ready; the words of the command.
fn prepare(spec: &TrainerSpec, command: &TrainerCommand, place: &Path) -> Result<Vec<String>> {
    let path = place.join("trainer.json");
    write_plain_json(&path, spec).context("writing trainer.json")?;
    fs::create_dir_all(&spec.checkpoint).context("making the checkpoint's folder")?;
    remove(&spec.out)?;
    let python = python();
    Ok(command.fill(|name| {
        let value = match name {
            "python" => &python,
            "spec" => &path,
            "out" => &spec.out,
            "init" => spec.init.as_ref().unwrap_or(&path),
            _ => &spec.checkpoint,
        };
        value.display().to_string()
    }))
}

/// The interpreter of the PyTorch trainer: `ISOFLOP_PYTHON`; else the one next to this program, as in a virtual
/// environment; else the first on the path.
pub fn python() -> PathBuf {
    let named = std::env::var_os("ISOFLOP_PYTHON").filter(|name| !name.is_empty());
    let beside = || {
        let own = std::env::current_exe().ok()?.with_file_name("python3");
        own.exists().then_some(own)
    };
    named.map(PathBuf::from).or_else(beside).unwrap_or_else(|| PathBuf::from("python3"))
}

/// The failure of the trainer in PyTorch that did not say why: most likely it is not installed.
fn of_torch(problem: Failure) -> Failure {
    let advice = "if Python has no module isoflop.torch, run `pip install 'isoflop[torch]'` there, or name \
                  another Python by ISOFLOP_PYTHON";
    match problem.kind {
        FailureKind::Trainer => Failure::new(problem.kind, format!("{}: {advice}", problem.reason)),
        _ => problem,
    }
}

/// Moves the weights of a result into the run's folder; an error message if they do not fit the run.
fn keep_weights(
    result: &TrainerResult,
    place: &Path,
    run: &RunSpec,
    assignment: &Assignment,
) -> Result<(), String> {
    let Some(named) = &result.weights else { return Ok(()) };
    let path = place.join(named);
    let kept = || -> Result<()> {
        let (found, _) = weights::load(&path)?;
        let sources = found.iter().map(|(name, own)| (name.clone(), Source::Host(own.clone())));
        let sources = sources.collect();
        // Whoever makes motions of them will ask for the same.
        generator::of(run).sampler(run, found, assignment.device)?;
        weights::save(&place.join(MODEL), &sources, weights_notes(&assignment.job.id))?;
        if path != place.join(MODEL) {
            remove(&path)?;
        }
        Ok(())
    };
    kept().map_err(|error| format!("the trainer's weights {}: {error:#}", path.display()))
}

// Tokenizers. The worker writes the clips and the first weights into the checkpoint's folder too, and takes the
// weights back.

/// The module that trains tokenizers.
const MODULE: &str = "isoflop.torch.tokenizer";

/// The trainer's result; losses and times are informative.
#[derive(Deserialize)]
struct TokenizerResult {
    /// The weights, next to the result or by absolute path.
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
    let words = tokenizer_words(&place, &handover);
    let problem = process::attend(&words, &place, &assignment.job.id, assignment.stop)?;
    let trained = match problem {
        Some(problem) => Err(refusal(&handover.files.out).unwrap_or_else(|| of_torch(problem))),
        None => read_tokenizer(&handover, corpus, assignment),
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
    let path = place.join("trainer.json");
    write_plain_json(&path, &handover).context("writing trainer.json")?;
    Ok(handover)
}

/// The trainer's command.
fn tokenizer_words(place: &Path, handover: &Handover) -> Vec<String> {
    let (python, spec) = (python(), place.join("trainer.json"));
    let HandoverFiles { out, checkpoint, .. } = &handover.files;
    let path = |path: &Path| path.display().to_string();
    let module = [path(&python), "-m".to_string(), MODULE.to_string()];
    let options = [("--spec", &spec), ("--out", out), ("--checkpoint", checkpoint)];
    let options = options.into_iter().flat_map(|(name, value)| [name.to_string(), path(value)]);
    module.into_iter().chain(options).collect()
}

/// The tokenizer of the weights that the trainer has left.
fn read_tokenizer(
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
