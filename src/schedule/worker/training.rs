//! Runs, and the trunks that they branch off.

use std::path::Path;
use std::time::Duration;

use anyhow::Result;
use burn::tensor::Device;

use super::record::record;
use super::{Outcome, beats, frozen_sweep, read, remove_checkpoint};
use crate::plan::{RunSpec, Trunk};
use crate::record::atomic::{write_bytes, write_json};
use crate::record::{JobId, JobKind, ResultsFolder};
use crate::schedule::signals::Stop;
use crate::schedule::trainer;
use crate::text::TextStore;
use crate::tokenizer::TokenStore;
use crate::train::{self, Branch, Checkpoints, Inputs, TrainError};

/// Trains a run from where it stands, or has its own trainer do so; its record is written whole,
/// after everything else.
pub fn train_run(
    folder: &ResultsFolder,
    job: &JobId,
    device: &Device,
    device_name: &str,
    stop: &Stop,
) -> Result<Outcome> {
    let place = folder.job(job);
    let spec: RunSpec = read(&place.join("spec.json"))?;
    if let Some(program) = &spec.trainer {
        return trainer::run_program(folder, &job.id, &spec, program, stop);
    }
    let desk = Desk::open(folder, &place, &spec)?;
    let trunk = spec.trunk().map(|trunk| (folder.trunk(&trunk.id()), trunk.steps));
    let branch = trunk.as_ref().filter(|(state, _)| state.exists());
    let branch = branch.map(|(state, steps)| Branch { state, steps: *steps });
    let checkpoints = Checkpoints { branch, ..desk.checkpoints() };
    let inputs = desk.inputs();
    let trained = train::train(&spec, &inputs, device, &checkpoints, &mut beats(&place, stop));
    let trained = match trained {
        Ok(trained) => trained,
        Err(error) => return Ok(ended_early(&error)),
    };
    write_results(&place, &job.id, &spec, &inputs, &trained, device_name)?;
    Ok(Outcome::Done)
}

/// Trains a trunk from the one that it goes on from up to where runs branch off.
pub fn train_trunk(
    folder: &ResultsFolder,
    job: &JobId,
    device: &Device,
    stop: &Stop,
) -> Result<Outcome> {
    let place = folder.job(job);
    let Trunk { spec, from, .. } = read(&place.join("job.json"))?;
    let desk = Desk::open(folder, &place, &spec)?;
    let before: Option<(_, Trunk)> = match from {
        Some(id) => {
            let place = folder.job(&JobId::new(JobKind::Trunk, &id));
            Some((folder.trunk(&id), read(&place.join("job.json"))?))
        }
        None => None,
    };
    let branch = before.as_ref().map(|(state, trunk)| Branch { state, steps: trunk.spec.steps });
    let checkpoints = Checkpoints { branch, ..desk.checkpoints() };
    let mut beats = beats(&place, stop);
    let state = folder.product(job);
    match train::train_trunk(&spec, &desk.inputs(), device, &checkpoints, &state, &mut beats) {
        Ok(()) => {
            remove_checkpoint(&place)?;
            Ok(Outcome::Done)
        }
        Err(error) => Ok(ended_early(&error)),
    }
}

fn ended_early(error: &TrainError) -> Outcome {
    match error {
        TrainError::Stopped { .. } => Outcome::Stopped,
        error => Outcome::Failed(error.to_string()),
    }
}

/// What a run reads, opened, and where its checkpoint lies.
struct Desk {
    tokens: TokenStore,
    text: TextStore,
    checkpoint: std::path::PathBuf,
    every: Duration,
}

impl Desk {
    fn open(folder: &ResultsFolder, place: &Path, spec: &RunSpec) -> Result<Self> {
        let every = frozen_sweep(folder)?.train.checkpoint_s;
        Ok(Self {
            tokens: TokenStore::open(&folder.tokens(&spec.tokenizer_id))?,
            text: TextStore::open(&folder.text(&spec.text_id))?,
            checkpoint: place.join("checkpoint/state.safetensors"),
            every: Duration::from_secs_f64(every.max(0.0)),
        })
    }

    fn inputs(&self) -> Inputs<'_> {
        Inputs { tokens: &self.tokens, text: &self.text }
    }

    fn checkpoints(&self) -> Checkpoints<'_> {
        Checkpoints { path: &self.checkpoint, every: self.every, branch: None }
    }
}

fn write_results(
    place: &Path,
    id: &str,
    spec: &RunSpec,
    inputs: &Inputs,
    trained: &train::Trained,
    device_name: &str,
) -> Result<()> {
    let weights = train::weights::of_module(&trained.model.weights);
    train::weights::save(&place.join("model.safetensors"), &weights, Default::default())?;
    let mut lines = String::new();
    for line in &trained.log {
        lines += &serde_json::to_string(line)?;
        lines.push('\n');
    }
    write_bytes(&place.join("log.jsonl"), lines.as_bytes())?;
    let record = record(id, spec, inputs, trained, device_name);
    write_json(&place.join("record.json"), &record)?;
    remove_checkpoint(place)?;
    Ok(())
}
