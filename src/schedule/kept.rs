//! How far an interrupted job is, by the checkpoint that it left.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use serde::Deserialize;

use super::worker::progress;
use crate::plan::{RunSpec, TokenizerJob, Trunk};
use crate::record::{JobId, JobKind, ResultsFolder, read_if_there};

/// The share of a job's steps that its checkpoint holds; 0 where that cannot be told.
///
/// Only the head of the checkpoint is read. A program of somebody's own keeps its checkpoint to
/// itself: what it last said of its steps stands for it.
pub fn share_kept(folder: &ResultsFolder, job: &JobId) -> f64 {
    let place = folder.job(job);
    let state = place.join("checkpoint/state.safetensors");
    let own = || {
        read::<RunSpec>(&place.join("spec.json"))?.trainer?;
        let beat = progress(&place)?;
        Some((beat.step, 0, beat.steps))
    };
    let Some((step, from, to)) = built_in(folder, job, &place, &state).or_else(own) else {
        return 0.0;
    };
    (step.saturating_sub(from) as f64 / to.saturating_sub(from).max(1) as f64).clamp(0.0, 1.0)
}

/// The step of a checkpoint, the one that the job began with, and the last.
fn built_in(
    folder: &ResultsFolder,
    job: &JobId,
    place: &Path,
    state: &Path,
) -> Option<(usize, usize, usize)> {
    let step = step_of(state)?;
    let from_trunk = |id: &str| {
        let path = folder.job(&JobId::new(JobKind::Trunk, id)).join("job.json");
        folder.trunk(id).exists().then(|| read::<Trunk>(&path))?.map(|trunk| trunk.spec.steps)
    };
    let (from, to) = match job.kind {
        JobKind::Tokenizer => (None, read::<TokenizerJob>(&place.join("job.json"))?.spec.steps),
        JobKind::Trunk => {
            let Trunk { from, spec, .. } = read(&place.join("job.json"))?;
            (from.and_then(|id| from_trunk(&id)), spec.steps)
        }
        _ => {
            let spec: RunSpec = read(&place.join("spec.json"))?;
            (spec.trunk().and_then(|trunk| from_trunk(&trunk.id())), spec.steps)
        }
    };
    Some((step, from.unwrap_or(0), to))
}

fn read<T: serde::de::DeserializeOwned>(path: &Path) -> Option<T> {
    read_if_there(path).ok().flatten()
}

/// What is read of the note that every checkpoint has.
#[derive(Deserialize)]
struct Standing {
    step: usize,
}

/// The head of a file of tensors: its length, then JSON with the notes under `__metadata__`.
fn step_of(state: &Path) -> Option<usize> {
    let mut file = File::open(state).ok()?;
    let mut length = [0; 8];
    file.read_exact(&mut length).ok()?;
    let mut head = Vec::new();
    file.take(u64::from_le_bytes(length)).read_to_end(&mut head).ok()?;
    let head: serde_json::Value = serde_json::from_slice(&head).ok()?;
    let standing: Standing =
        serde_json::from_str(head["__metadata__"]["standing"].as_str()?).ok()?;
    Some(standing.step)
}
