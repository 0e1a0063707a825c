//! The codes that a tokenizer gives a data set.

use std::ops::ControlFlow;
use std::path::PathBuf;

use anyhow::Result;

use super::assignment::{Assignment, Outcome};
use super::folder::{CHECKPOINT, ResultsFolder};
use super::id::JobId;
use super::job::Job;
use super::kind::{JobKind, Kind};
use super::mend::put_away;
use super::tokenizer;
use crate::plan::{Plan, TokenizerJob, tokens_peak_bytes};
use crate::sweep::Stage;
use crate::tokenizer::{Corpus, Parts, Tokenizer, share_kept, tokenize};

/// Turns every clip of the data into codes.
pub struct Tokens;

/// As a kind of job.
pub const KIND: JobKind = JobKind::from_static(&Tokens);

/// What tokenising costs, as a share of training the tokenizer.
const SHARE_OF_TRAINING: f64 = 0.1;

impl Kind for Tokens {
    fn word(&self) -> &'static str {
        "tokens"
    }

    fn plural(&self) -> &'static str {
        "tokens"
    }

    fn role(&self) -> &'static str {
        "tokenising"
    }

    fn folder(&self, id: &str) -> PathBuf {
        tokenizer::KIND.folder(id).join("tokens")
    }

    fn product(&self) -> &'static str {
        "codes.safetensors"
    }

    fn spec(&self, id: &str) -> PathBuf {
        tokenizer::KIND.spec(id)
    }

    fn stage(&self) -> Stage {
        Stage::Inputs
    }

    fn jobs(&self, plan: &Plan) -> Vec<Job> {
        let job = |job: &TokenizerJob| Job {
            id: JobId::new(KIND, job.id()),
            label: format!("codes V{}", job.spec.n_vocab()),
            cost: SHARE_OF_TRAINING * tokenizer::cost(job),
            peak_bytes: tokens_peak_bytes(&job.spec, &plan.data),
            needs: tokenizer::captions(job)
                .into_iter()
                .chain([JobId::new(tokenizer::KIND, job.id())])
                .collect(),
        };
        plan.tokenizers.iter().map(job).collect()
    }

    fn work(&self, assignment: &Assignment) -> Result<Outcome> {
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
        assignment.remove_checkpoint()?;
        Ok(Outcome::Done)
    }

    fn share_done(&self, folder: &ResultsFolder, id: &str) -> f64 {
        share_kept(&folder.job(&JobId::new(KIND, id)).join(CHECKPOINT))
    }
}

/// The trained tokenizer; if its files are damaged it is trained again here. `Break` if that gives none,
/// and how it ended.
fn load_or_retrain(assignment: &Assignment) -> Result<ControlFlow<Outcome, Tokenizer>> {
    let job = JobId::new(tokenizer::KIND, &assignment.job.id);
    let place = assignment.folder.job(&job);
    let error = match Tokenizer::load(&place, assignment.device) {
        Ok(tokenizer) => return Ok(ControlFlow::Continue(tokenizer)),
        Err(error) => error,
    };
    let Some(file) = error.damaged_file() else { return Err(error.into()) };
    put_away(&place.join("weights.safetensors"), file, "the tokenizer is trained again")?;
    Ok(match tokenizer::KIND.work(&assignment.of(&job))? {
        Outcome::Done => ControlFlow::Continue(Tokenizer::load(&place, assignment.device)?),
        ended => ControlFlow::Break(ended),
    })
}
