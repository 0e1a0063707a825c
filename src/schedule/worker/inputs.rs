//! What runs need: embedded captions, a tokenizer, the codes that it gives the data.

use std::time::Instant;

use anyhow::Result;
use burn::tensor::Device;

use super::mend::{is_damaged, put_away};
use super::{Outcome, beats, frozen_sweep, read, remove_checkpoint};
use crate::data::{self, MotionSource};
use crate::moving::Progress;
use crate::plan::TokenizerJob;
use crate::record::atomic::write_json;
use crate::record::damaged::is_damage;
use crate::record::{JobId, JobKind, ResultsFolder};
use crate::schedule::signals::Stop;
use crate::text;
use crate::tokenizer::{self, Checkpoints, Tokenizer, TokenizerError, TokenizerSpec};

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
    let checkpoints = Checkpoints { path: &path, every: sweep.train.checkpoint_every() };
    let mut beats = beats(&place, stop);
    let tokenizer = match trained(&spec, &*source, device, checkpoints, &mut beats) {
        Err(TokenizerError::Stopped { .. }) => return Ok(Outcome::Stopped),
        trained => trained?,
    };
    tokenizer.save(&place)?;
    let wall_s = started.elapsed().as_secs_f64();
    let metrics = tokenizer::evaluate(&tokenizer, &*source, &job.id, wall_s)?;
    write_json(&folder.product(job), &metrics)?;
    remove_checkpoint(&place)?;
    Ok(Outcome::Done)
}

/// Trains from the checkpoint, or from the beginning where that is damaged.
fn trained(
    spec: &TokenizerSpec,
    source: &dyn MotionSource,
    device: &Device,
    checkpoints: Checkpoints,
    progress: &mut Progress,
) -> Result<Tokenizer, TokenizerError> {
    match tokenizer::train(spec, source, device, Some(checkpoints), progress) {
        Err(TokenizerError::Weights(error)) if is_damaged(&error, checkpoints.path) => {
            let instead = "the tokenizer begins again";
            put_away(checkpoints.path, &error.to_string(), instead).map_err(other)?;
            tokenizer::train(spec, source, device, Some(checkpoints), progress)
        }
        trained => trained,
    }
}

fn other(error: anyhow::Error) -> TokenizerError {
    TokenizerError::Write(std::io::Error::other(format!("{error:#}")))
}

/// Turns every clip of the data into codes.
pub fn tokenize(
    folder: &ResultsFolder,
    job: &JobId,
    device: &Device,
    stop: &Stop,
) -> Result<Outcome> {
    let sweep = frozen_sweep(folder)?;
    let source = data::open(&sweep.data, 0)?;
    let Some(tokenizer) = load_or_retrain(folder, &job.id, device, stop)? else {
        return Ok(Outcome::Stopped);
    };
    tokenizer::tokenize(&tokenizer, &*source, &folder.product(job))?;
    Ok(Outcome::Done)
}

/// The trained tokenizer; where its files are damaged it is trained again here. `None`: stopped.
fn load_or_retrain(
    folder: &ResultsFolder,
    id: &str,
    device: &Device,
    stop: &Stop,
) -> Result<Option<Tokenizer>> {
    let place = folder.tokenizer(id);
    let reason = match Tokenizer::load(&place, device) {
        Err(error) if is_damage(&error.to_string()) => error.to_string(),
        loaded => return Ok(Some(loaded?)),
    };
    put_away(&place.join("weights.safetensors"), &reason, "the tokenizer is trained again")?;
    match train_tokenizer(folder, &JobId::new(JobKind::Tokenizer, id), device, stop)? {
        Outcome::Done => Ok(Some(Tokenizer::load(&place, device)?)),
        _ => Ok(None),
    }
}
