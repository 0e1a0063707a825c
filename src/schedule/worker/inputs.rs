//! What runs need: embedded captions, a tokenizer, the codes that it gives the data.

use std::time::{Duration, Instant};

use anyhow::Result;
use burn::tensor::Device;

use super::{Outcome, beats, frozen_sweep, read, remove_checkpoint};
use crate::data;
use crate::plan::TokenizerJob;
use crate::record::atomic::write_json;
use crate::record::{JobId, ResultsFolder};
use crate::schedule::signals::Stop;
use crate::text;
use crate::tokenizer::{self, Checkpoints, Tokenizer, TokenizerError};

/// Embeds every caption of the data once.
pub fn embed_text(folder: &ResultsFolder, job: &JobId) -> Result<Outcome> {
    let sweep = frozen_sweep(folder)?;
    let source = data::open(&sweep.data, 0)?;
    text::embed(&*text::encoder(&sweep.text), &*source, &folder.product(job))?;
    Ok(Outcome::Done)
}

/// Trains a tokenizer and measures it; metrics are written last.
pub fn train_tokenizer(
    folder: &ResultsFolder,
    job: &JobId,
    device: &Device,
    stop: &Stop,
) -> Result<Outcome> {
    let started = Instant::now();
    let place = folder.job(job);
    let spec = read::<TokenizerJob>(&place.join("job.json"))?.spec;
    let sweep = frozen_sweep(folder)?;
    let source = data::open(&sweep.data, 0)?;
    let path = place.join("checkpoint/state.safetensors");
    let every = Duration::from_secs_f64(sweep.train.checkpoint_s.max(0.0));
    let checkpoints = Some(Checkpoints { path: &path, every });
    let trained = tokenizer::train(&spec, &*source, device, checkpoints, &mut beats(&place, stop));
    let tokenizer = match trained {
        Ok(tokenizer) => tokenizer,
        Err(TokenizerError::Stopped { .. }) => return Ok(Outcome::Stopped),
        Err(error) => return Ok(Outcome::Failed(error.to_string())),
    };
    tokenizer.save(&place)?;
    let wall_s = started.elapsed().as_secs_f64();
    let metrics = tokenizer::evaluate(&tokenizer, &*source, &job.id, wall_s)?;
    write_json(&folder.product(job), &metrics)?;
    remove_checkpoint(&place)?;
    Ok(Outcome::Done)
}

/// Turns every clip of the data into codes.
pub fn tokenize(folder: &ResultsFolder, job: &JobId, device: &Device) -> Result<Outcome> {
    let sweep = frozen_sweep(folder)?;
    let source = data::open(&sweep.data, 0)?;
    let tokenizer = Tokenizer::load(&folder.tokenizer(&job.id), device)?;
    tokenizer::tokenize(&tokenizer, &*source, &folder.product(job))?;
    Ok(Outcome::Done)
}
