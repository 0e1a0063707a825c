//! The jobs of a sweep.
//!
//! A [`JobKind`] defines product, folder, inputs and cost; [`work`] runs a job. [`JobKind::ALL`] lists the kinds.
//!
//! # Example
//!
//! ```
//! use isoflop::data::DataFacts;
//! use isoflop::jobs::all_jobs;
//! use isoflop::plan::Plan;
//! use isoflop::sweep;
//!
//! let text = "name: first\ngrid: {models: scamo, vocab: [256], budgets: [1e18]}\n";
//! let sweep = sweep::parse("first.yaml", text, &[])?;
//! let plan = Plan::new(&sweep, DataFacts::absent("no motion yet".to_string()));
//! // Captions, a tokenizer and its codes come before the runs.
//! assert!(all_jobs(&plan).count() > plan.runs.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[cfg(feature = "train")]
mod assignment;
mod folder;
#[cfg(feature = "train")]
pub mod gpu;
mod graph;
mod job;
#[cfg(feature = "train")]
pub mod presence;
#[cfg(feature = "train")]
pub mod program;
mod run_scores;
#[cfg(feature = "train")]
mod score;
#[cfg(feature = "train")]
mod seen;
#[cfg(feature = "train")]
pub mod speed;
#[cfg(feature = "train")]
mod state;
#[cfg(feature = "train")]
mod tokenizer;
#[cfg(feature = "train")]
mod trained;
#[cfg(feature = "train")]
mod training;
#[cfg(feature = "train")]
pub mod worker;

#[cfg(feature = "train")]
pub use assignment::{Assignment, Outcome};
pub use folder::{JobState, ResultsFolder, RunStates};
pub use graph::{all_jobs, inputs, missing_jobs, with_needs};
pub use job::{Job, JobId, JobKind};
pub use run_scores::{RunScores, ScoredPhysics};
#[cfg(feature = "train")]
pub use score::Scoring;
#[cfg(feature = "train")]
pub use seen::Counts;
#[cfg(feature = "train")]
pub use state::{FailedJob, Running, SweepState, sweep_state, time_left};
#[cfg(feature = "train")]
pub use tokenizer::TrainedTokenizer;
#[cfg(feature = "train")]
pub use trained::{MadeMotion, TrainedRun, TrustedEvaluator};

use std::fs;
use std::path::Path;

use anyhow::Result;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::files::{FileError, atomic, read_if_there};
use crate::plan::Plan;

/// Does a job in the process of a worker, unless it is done already.
///
/// # Errors
/// Why it has no result.
#[cfg(feature = "train")]
pub fn work(assignment: &Assignment) -> Result<Outcome> {
    if assignment.folder.state(assignment.job) == JobState::Done {
        return Ok(Outcome::Done);
    }
    match assignment.job.kind {
        JobKind::Text => tokenizer::embed_captions(assignment),
        JobKind::Tokenizer => tokenizer::train(assignment),
        JobKind::Tokens => tokenizer::make_codes(assignment),
        JobKind::Trunk => training::train_trunk(assignment),
        JobKind::Run => training::train_run(assignment),
        JobKind::Evaluator => training::train_evaluator(assignment),
        JobKind::Score => score::score(assignment),
    }
}

// Preparation of a folder for its jobs.

/// Writes the specs of a plan's jobs into its folder; calls `warn` for each that differed.
///
/// The trunk that another trunk continues depends on the sweep's budgets, but its result does not. So these specs are
/// rewritten each time.
///
/// # Errors
/// The folder cannot be written to.
pub fn write_specs(
    plan: &Plan,
    folder: &ResultsFolder,
    warn: &mut dyn FnMut(String),
) -> Result<(), FileError> {
    let path = |kind: JobKind, id: &str| folder.file(kind.spec(id));
    for job in &plan.tokenizers {
        write_once(&path(JobKind::Tokenizer, &job.id()), job, warn)?;
    }
    for trunk in &plan.trunks {
        atomic::write_json(&path(JobKind::Trunk, &trunk.trunk_id), trunk)?;
    }
    for run in &plan.runs {
        let path = path(JobKind::Run, &run.run_id);
        let is_done = folder.product(&JobId::run(&run.run_id)).exists();
        if !is_done || !path.exists() {
            write_once(&path, &run.spec, warn)?;
        }
    }
    if let Some(job) = &plan.evaluator {
        write_once(&path(JobKind::Evaluator, &job.id()), job, warn)?;
    }
    for job in &plan.scores {
        write_once(&path(JobKind::Score, &job.id()), job, warn)?;
    }
    Ok(())
}

/// Writes a spec, unless it is there: one that is there is right unless it is damaged, and then it
/// is written again, so there is no need to wait for the disk.
fn write_once<T>(path: &Path, value: &T, warn: &mut dyn FnMut(String)) -> Result<(), FileError>
where
    T: Serialize + DeserializeOwned + PartialEq,
{
    match read_if_there::<T>(path) {
        Ok(Some(there)) if there == *value => return Ok(()),
        Ok(None) => {}
        Ok(Some(_)) => warn(format!("{} differs from the plan; rewritten", path.display())),
        Err(error) => warn(format!("{error}: done")),
    }
    atomic::write_json_unflushed(path, value)
}

/// Copies finished captions, tokenizers and codes of a plan from `from` to `to`. Ids are hashes of content, so equal
/// ids mean equal products.
///
/// # Errors
/// A file cannot be read or written.
pub fn adopt(plan: &Plan, from: &ResultsFolder, to: &ResultsFolder) -> Result<(), FileError> {
    let is_new =
        |id: &JobId| from.state(id) == JobState::Done && matches!(to.state(id), JobState::Missing);
    let jobs = inputs(plan).into_iter().map(|job| job.id);
    jobs.filter(is_new).try_for_each(|id| copy(&id, from, to))
}

/// The product last: a job is done from then on.
fn copy(id: &JobId, from: &ResultsFolder, to: &ResultsFolder) -> Result<(), FileError> {
    let (source, product) = (from.job(id), from.product(id));
    let entries = fs::read_dir(&source).map_err(FileError::read(&source))?;
    let paths = entries.flatten().map(|entry| entry.path());
    for path in paths.filter(|path| path.is_file() && *path != product) {
        copy_whole(&path, &to.job(id))?;
    }
    copy_whole(&product, &to.job(id))
}

fn copy_whole(file: &Path, folder: &Path) -> Result<(), FileError> {
    let bytes = fs::read(file).map_err(FileError::read(file))?;
    atomic::write_bytes(&folder.join(file.file_name().unwrap_or_default()), &bytes)
}
