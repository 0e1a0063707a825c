//! A trained tokenizer and its metrics.

use std::ops::ControlFlow;
use std::time::Instant;

use anyhow::Result;

use super::assignment::{Assignment, Outcome};
use super::job::captions;
use super::mend::{open_or_remake, train_past_damage};
use super::{program, text};
use crate::files::atomic::{write_json, write_json_lines};
use crate::learn::Checkpoints;
use crate::progress::beats;
use crate::spec::TokenizerJob;
use crate::spec::TokenizerSpec;
use crate::text::TextStore;
use crate::tokenizer::{self, Corpus, TokenizerError, TokenizerMetrics, Validated};

/// Trains a tokenizer and measures it; metrics are written last.
pub fn work(assignment: &Assignment) -> Result<Outcome> {
    let started = Instant::now();
    let place = assignment.place();
    let (source, text) = (assignment.source()?, open_text(assignment)?);
    let corpus = Corpus { source: &*source, text: text.as_ref() };
    let (tokenizer, log) = match trained(assignment, &corpus)? {
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
    assignment.done()
}

/// The captions that the tokenizer of an assignment sees; where they are damaged they are made again
/// first.
///
/// # Errors
/// They can neither be opened nor made.
pub fn open_text(assignment: &Assignment) -> Result<Option<TextStore>> {
    let needed = captions(&assignment.spec::<TokenizerJob>()?);
    needed.map(|text| open_or_remake(assignment, &text, TextStore::open, text::work)).transpose()
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
