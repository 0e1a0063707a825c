//! The codes that a tokenizer gives a data set.

use std::ops::ControlFlow;

use anyhow::Result;

use super::assignment::{Assignment, Outcome};
use super::folder::CHECKPOINT;
use super::id::JobId;
use super::kind::JobKind;
use super::mend::put_away;
use super::tokenizer;
use crate::tokenizer::{Corpus, Parts, Tokenizer, tokenize};

/// Turns every clip of the data into codes.
pub fn work(assignment: &Assignment) -> Result<Outcome> {
    let tokenizer = match load_or_retrain(assignment)? {
        ControlFlow::Continue(tokenizer) => tokenizer,
        ControlFlow::Break(ended) => return Ok(ended),
    };
    let (source, text) = (assignment.source()?, tokenizer::open_text(assignment)?);
    let corpus = Corpus { source: &*source, text: text.as_ref() };
    let kept = assignment.place().join(CHECKPOINT);
    let parts = Parts { folder: &kept, stop: assignment.stop };
    let Some(()) = tokenize(&tokenizer, &corpus, &assignment.product(), parts)? else {
        return Ok(Outcome::Stopped);
    };
    assignment.done()
}

/// The trained tokenizer; if its files are damaged it is trained again here. `Break` if that gives none,
/// and how it ended.
fn load_or_retrain(assignment: &Assignment) -> Result<ControlFlow<Outcome, Tokenizer>> {
    let job = JobId::new(JobKind::Tokenizer, &assignment.job.id);
    let place = assignment.folder.job(&job);
    let error = match Tokenizer::load(&place, assignment.device) {
        Ok(tokenizer) => return Ok(ControlFlow::Continue(tokenizer)),
        Err(error) => error,
    };
    let Some(file) = error.damaged_file() else { return Err(error.into()) };
    put_away(&place.join("weights.safetensors"), file, "the tokenizer is trained again")?;
    Ok(match tokenizer::work(&assignment.of(&job))? {
        Outcome::Done => ControlFlow::Continue(Tokenizer::load(&place, assignment.device)?),
        ended => ControlFlow::Break(ended),
    })
}
