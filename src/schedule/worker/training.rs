//! Runs, and the trunks that they branch off.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Result;
use burn::tensor::Device;

use super::mend::{is_damaged, open_or_remake, put_away};
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
        if folder.tokens(&spec.tokenizer_id).exists() {
            Desk::open(folder, &place, &spec, None, device, stop)?;
        }
        return trainer::run_program(folder, &job.id, &spec, program, stop);
    }
    let trunk = spec.trunk().map(|trunk| (folder.trunk(&trunk.id()), trunk.steps));
    let desk = Desk::open(folder, &place, &spec, trunk, device, stop)?;
    let (inputs, mut beats) = (desk.inputs(), beats(&place, stop));
    let trained = desk
        .begin_whole(|checkpoints| train::train(&spec, &inputs, device, checkpoints, &mut beats))?;
    let Some(trained) = trained else { return Ok(Outcome::Stopped) };
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
    let before = match from {
        Some(id) => {
            let place = folder.job(&JobId::new(JobKind::Trunk, &id));
            Some((folder.trunk(&id), read::<Trunk>(&place.join("job.json"))?.spec.steps))
        }
        None => None,
    };
    let desk = Desk::open(folder, &place, &spec, before, device, stop)?;
    let (state, mut beats) = (folder.product(job), beats(&place, stop));
    let trained = desk.begin_whole(|checkpoints| {
        train::train_trunk(&spec, &desk.inputs(), device, checkpoints, &state, &mut beats)
    })?;
    if trained.is_none() {
        return Ok(Outcome::Stopped);
    }
    remove_checkpoint(&place)?;
    Ok(Outcome::Done)
}

/// What a run reads, opened, and where its state lies.
struct Desk {
    tokens: TokenStore,
    text: TextStore,
    checkpoint: PathBuf,
    every: Duration,
    /// The state of the trunk that it goes on from, and the steps done there.
    trunk: Option<(PathBuf, usize)>,
}

impl Desk {
    fn open(
        folder: &ResultsFolder,
        place: &Path,
        spec: &RunSpec,
        trunk: Option<(PathBuf, usize)>,
        device: &Device,
        stop: &Stop,
    ) -> Result<Self> {
        let tokens = JobId::new(JobKind::Tokens, &spec.tokenizer_id);
        let text = JobId::new(JobKind::Text, &spec.text_id);
        Ok(Self {
            tokens: open_or_remake(folder, &tokens, device, stop, TokenStore::open)?,
            text: open_or_remake(folder, &text, device, stop, TextStore::open)?,
            checkpoint: place.join("checkpoint/state.safetensors"),
            every: frozen_sweep(folder)?.train.checkpoint_every(),
            trunk,
        })
    }

    fn inputs(&self) -> Inputs<'_> {
        Inputs { tokens: &self.tokens, text: &self.text }
    }

    /// Trunks shorten the way and change no result, so one that is gone is done without.
    fn checkpoints(&self) -> Checkpoints<'_> {
        let trunk = self.trunk.as_ref().filter(|(state, _)| state.exists());
        let branch = trunk.map(|(state, steps)| Branch { state, steps: *steps });
        Checkpoints { path: &self.checkpoint, every: self.every, branch }
    }

    /// Trains; where the checkpoint or the trunk turns out to be damaged, again without it.
    /// `None`: stopped.
    fn begin_whole<T>(
        &self,
        mut train: impl FnMut(&Checkpoints) -> Result<T, TrainError>,
    ) -> Result<Option<T>> {
        loop {
            let error = match train(&self.checkpoints()) {
                Ok(trained) => return Ok(Some(trained)),
                Err(TrainError::Stopped { .. }) => return Ok(None),
                Err(error) => error,
            };
            let Some(path) = self.damaged(&error) else { return Err(error.into()) };
            put_away(path, &error.to_string(), "training begins before it")?;
        }
    }

    /// The file of this desk that an error is about.
    fn damaged(&self, error: &TrainError) -> Option<&Path> {
        let TrainError::Weights(error) = error else { return None };
        let trunk = self.trunk.iter().map(|(state, _)| state.as_path());
        trunk.chain([self.checkpoint.as_path()]).find(|path| is_damaged(error, path))
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
