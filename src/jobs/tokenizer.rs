//! A trained tokenizer and its metrics.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Result;

use super::assignment::{Assignment, Outcome};
use super::folder::ResultsFolder;
use super::id::JobId;
use super::job::Job;
use super::kind::{JobKind, Kind};
use super::mend::{open_or_remake, train_past_damage};
use super::program;
use super::spec_file::write_once;
use super::text;
use crate::files::atomic::{write_json, write_json_lines};
use crate::files::{FileError, read_if_there};
use crate::learn::{Checkpoints, step_of};
use crate::plan::{Plan, TokenizerJob, tokenizer_peak_bytes};
use crate::progress::beats;
use crate::spec::TokenizerSpec;
use crate::sweep::Stage;
use crate::text::TextStore;
use crate::tokenizer::{self, Corpus, TokenizerError, TokenizerMetrics, Validated};

/// Trains a tokenizer and measures it; metrics are written last.
pub struct Tokenizer;

/// As a kind of job.
pub const KIND: JobKind = JobKind::from_static(&Tokenizer);

/// FLOPs that training a tokenizer counts for, beside the budgets of runs.
pub fn cost(job: &TokenizerJob) -> f64 {
    let training = &job.spec.training;
    let frames = (training.steps * training.batch * training.window) as f64;
    frames * job.spec.flops_per_frame()
}

impl Kind for Tokenizer {
    fn word(&self) -> &'static str {
        "tokenizer"
    }

    fn plural(&self) -> &'static str {
        "tokenizers"
    }

    fn role(&self) -> &'static str {
        "its tokenizer"
    }

    fn folder(&self, id: &str) -> PathBuf {
        PathBuf::from("tokenizers").join(id)
    }

    fn product(&self) -> &'static str {
        "metrics.json"
    }

    fn spec(&self, id: &str) -> PathBuf {
        self.folder(id).join("job.json")
    }

    fn stage(&self) -> Stage {
        Stage::Inputs
    }

    fn jobs(&self, plan: &Plan) -> Vec<Job> {
        let job = |job: &TokenizerJob| Job {
            id: JobId::new(KIND, job.id()),
            label: format!("{} tokenizer V{}", job.spec.quantizer.name(), job.spec.n_vocab()),
            cost: cost(job),
            peak_bytes: tokenizer_peak_bytes(&job.spec, &plan.data),
            needs: captions(job).into_iter().collect(),
        };
        plan.tokenizers.iter().map(job).collect()
    }

    fn prepare(
        &self,
        plan: &Plan,
        folder: &ResultsFolder,
        warn: &mut dyn FnMut(String),
    ) -> Result<(), FileError> {
        let write = |job: &TokenizerJob| write_once(&folder.file(self.spec(&job.id())), job, warn);
        plan.tokenizers.iter().try_for_each(write)
    }

    fn inspect(&self, folder: &ResultsFolder, id: &str) -> Result<(), FileError> {
        folder.metrics(id).map(|_| ())
    }

    fn is_result(&self) -> bool {
        true
    }

    fn share_done(&self, folder: &ResultsFolder, id: &str) -> f64 {
        let job = JobId::new(KIND, id);
        let spec = read_if_there::<TokenizerJob>(&folder.spec(&job)).ok().flatten();
        let step = step_of(&folder.checkpoint(&job));
        let share =
            |(step, job): (usize, TokenizerJob)| step as f64 / job.spec.training.steps as f64;
        step.zip(spec).map_or(0.0, share)
    }

    fn work(&self, assignment: &Assignment) -> Result<Outcome> {
        let started = Instant::now();
        let place = assignment.place();
        let (source, text) = (assignment.source()?, open_text(assignment)?);
        let corpus = Corpus { source: &*source, text: text.as_ref() };
        let trained = trained(assignment, &corpus)?;
        let (tokenizer, log) = match trained {
            ControlFlow::Continue(trained) => trained,
            ControlFlow::Break(ended) => return Ok(ended),
        };
        tokenizer.save(&place)?;
        if !log.is_empty() {
            write_json_lines(&place.join("log.jsonl"), &log)?;
        }
        let wall_s = started.elapsed().as_secs_f64();
        let metrics = tokenizer::evaluate(&tokenizer, &corpus, &assignment.job.id, wall_s)?;
        let k_means = tokenizer::k_means_baseline(tokenizer.spec(), &*source, assignment.device)?;
        let train_steps = tokenizer::best(&log).map_or(metrics.train_steps, |line| line.step);
        let metrics = TokenizerMetrics { k_means, train_steps, ..metrics };
        write_json(&assignment.product(), &metrics)?;
        assignment.remove_checkpoint()?;
        Ok(Outcome::Done)
    }

    fn grace(&self, place: &Path) -> Duration {
        program::tokenizer_grace(place)
    }
}

/// The job that a tokenizer with language waits for: the captions that it sees.
pub fn captions(job: &TokenizerJob) -> Option<JobId> {
    job.text_id.as_ref().map(|id| JobId::new(text::KIND, id))
}

/// The captions that the tokenizer of an assignment sees; where they are damaged they are made again
/// first.
///
/// # Errors
/// They can neither be opened nor made.
pub fn open_text(assignment: &Assignment) -> Result<Option<TextStore>> {
    let needed = captions(&assignment.spec::<TokenizerJob>()?);
    needed.map(|text| open_or_remake(assignment, &text, TextStore::open)).transpose()
}

/// A tokenizer and what the validation split said of it; or how the job ended without one.
type Trained = ControlFlow<Outcome, (tokenizer::Tokenizer, Vec<Validated>)>;

/// Trains by the trainer of the spec.
fn trained(assignment: &Assignment, corpus: &Corpus) -> Result<Trained> {
    let job = assignment.spec::<TokenizerJob>()?;
    if job.spec.trainer.is_built_in() {
        return trained_here(&job.spec, assignment, corpus);
    }
    let text = captions(&job).map(|text| assignment.folder.product(&text));
    let made = program::train_tokenizer(assignment, &job, corpus, text)?;
    Ok(made.map_continue(|tokenizer| (tokenizer, Vec::new())))
}

/// Trains from the checkpoint, or from the beginning if that is damaged.
fn trained_here(spec: &TokenizerSpec, assignment: &Assignment, corpus: &Corpus) -> Result<Trained> {
    let (path, every) = (assignment.checkpoint(), assignment.checkpoint_every()?);
    let checkpoints = Checkpoints { path: &path, every, branch: None };
    let place = assignment.place();
    let mut beats = beats(&place, assignment.stop);
    let trained = train_past_damage(&[&path], TokenizerError::learn_error, || {
        tokenizer::train_watched(spec, corpus, assignment.device, Some(&checkpoints), &mut beats)
    })?;
    Ok(trained.map_or(ControlFlow::Break(Outcome::Stopped), ControlFlow::Continue))
}
