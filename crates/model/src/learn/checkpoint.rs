//! Checkpoints: all that learning needs to go on with the same bits, in one file.

use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::time::Duration;

use burn::module::Module;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::adamw::AdamW;
use super::weights::{self, Sources, Weights};
use crate::files::FileError;

/// Where the state of something that learns lies.
#[derive(Clone, Copy, Debug)]
pub struct Checkpoints<'a> {
    /// Written now and then; where it is there, learning goes on from it. The caller removes it,
    /// after the result is whole.
    pub path: &'a Path,
    /// Never changes the result.
    pub every: Duration,
    /// What learning begins with that has no checkpoint yet.
    pub branch: Option<Branch<'a>>,
}

/// The end of a trunk, from which runs go on.
#[derive(Clone, Copy, Debug)]
pub struct Branch<'a> {
    pub state: &'a Path,
    /// The steps that are done there.
    pub steps: usize,
}

/// What a learner keeps of itself beside its weights and their moments.
#[derive(Debug, Default)]
pub struct LearnerState {
    pub note: Value,
    pub tensors: Sources,
}

/// What [`LearnerState`] was, read again.
#[derive(Debug, Default)]
pub struct LoadedState {
    pub note: Value,
    pub tensors: Weights,
}

/// What is no tensor.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Header {
    /// Steps done.
    pub step: usize,
    /// Seconds spent before this process.
    pub wall_s: f64,
    /// The learner's own note.
    #[serde(default)]
    pub learner: Value,
}

const HEADER: &str = "header";
const WEIGHTS: &str = "weights.";
const LEARNER: &str = "learner.";

/// Writes a checkpoint whole, by rename, in place of the last one.
pub(super) fn save<M: Module>(
    path: &Path,
    module: &M,
    optimiser: &AdamW,
    kept: LearnerState,
    header: Header,
) -> Result<(), FileError> {
    let (_, mut tensors) = optimiser.state();
    tensors.extend(prefixed(WEIGHTS, weights::of_module(module)));
    tensors.extend(prefixed(LEARNER, kept.tensors));
    let header = Header { learner: kept.note, ..header };
    let header = serde_json::to_string(&header).expect("plain values");
    weights::save(path, &tensors, HashMap::from([(HEADER.to_string(), header)]))
}

fn prefixed(prefix: &str, sources: Sources) -> impl Iterator<Item = (String, weights::Source)> {
    sources.into_iter().map(move |(name, tensor)| (format!("{prefix}{name}"), tensor))
}

/// A checkpoint, read.
pub(super) struct Loaded<M> {
    pub module: M,
    pub optimiser: AdamW,
    pub saved: LoadedState,
    pub header: Header,
}

/// Reads a checkpoint into a fresh module and optimiser.
///
/// # Errors
/// [`FileError::Read`]; [`FileError::Damaged`] also where it belongs to something else.
pub(super) fn load<M: Module>(
    path: &Path,
    module: M,
    optimiser: AdamW,
) -> Result<Loaded<M>, FileError> {
    let (mut tensors, notes) = weights::load(path)?;
    let damaged = |reason: &str| FileError::damaged(path, reason);
    let header = notes.get(HEADER).ok_or_else(|| damaged("no header in it"))?;
    let mut header: Header =
        serde_json::from_str(header).map_err(|error| damaged(&error.to_string()))?;
    let parameters = take(&mut tensors, WEIGHTS);
    let saved = LoadedState { note: header.learner.take(), tensors: take(&mut tensors, LEARNER) };
    let module =
        weights::into_module(module, parameters).map_err(|error| damaged(&error.to_string()))?;
    let steps = i32::try_from(header.step).map_err(|_| damaged("an impossible step"))?;
    let device = module.devices().swap_remove(0).inner();
    let optimiser = optimiser.with_state(steps, tensors, &device);
    let optimiser = optimiser.ok_or_else(|| damaged("moments are missing"))?;
    Ok(Loaded { module, optimiser, saved, header })
}

/// The tensors whose names begin with a prefix, without it.
fn take(tensors: &mut Weights, prefix: &str) -> Weights {
    let all = std::mem::take(tensors);
    let (wanted, others): (Weights, Weights) =
        all.into_iter().partition(|(name, _)| name.starts_with(prefix));
    *tensors = others;
    wanted.into_iter().map(|(name, tensor)| (name[prefix.len()..].to_string(), tensor)).collect()
}

/// The step of a checkpoint, from the head of its file alone; `None` where that cannot be told.
pub fn step_of(path: &Path) -> Option<usize> {
    let mut file = File::open(path).ok()?;
    let mut length = [0; 8];
    file.read_exact(&mut length).ok()?;
    let mut head = Vec::new();
    file.take(u64::from_le_bytes(length)).read_to_end(&mut head).ok()?;
    let head: Value = serde_json::from_slice(&head).ok()?;
    let header: Header = serde_json::from_str(head["__metadata__"][HEADER].as_str()?).ok()?;
    Some(header.step)
}
