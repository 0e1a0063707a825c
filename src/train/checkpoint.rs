//! Checkpoints: all that a run needs to go on with the same bits, in one file.

use std::collections::HashMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::adamw::AdamW;
use super::weights::{self, Weights, WeightsError};
use crate::model::Model;

/// What a run wrote down of one moment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LogLine {
    pub step: usize,
    /// Supervised tokens so far.
    pub tokens: usize,
    pub lr: f64,
    /// Mean cross-entropy of the steps since the last line, in nats.
    pub train_loss_nats: f64,
    /// L_u on the validation split.
    pub val_loss_normalised: f64,
}

/// Where a run stands, beside its weights and moments.
///
/// The data position is the step: what a step supervises is a pure function of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Standing {
    /// Steps done.
    pub step: usize,
    /// Sum of the losses since the last log line, and their number.
    pub loss_sum: f64,
    pub loss_count: usize,
    /// Forward FLOPs done, by the exact count.
    pub forward_flops: f64,
    /// Seconds spent before this process.
    pub wall_s: f64,
    pub log: Vec<LogLine>,
}

const STANDING: &str = "standing";
const MODEL: &str = "model.";

/// Writes a checkpoint whole, by rename, in place of the last one.
pub fn save(
    path: &Path,
    model: &Model,
    optimiser: &AdamW,
    standing: &Standing,
) -> Result<(), WeightsError> {
    let (_, mut tensors) = optimiser.state();
    let parameters = weights::of_module(&model.weights);
    tensors.extend(parameters.into_iter().map(|(name, tensor)| (format!("{MODEL}{name}"), tensor)));
    let standing = serde_json::to_string(standing).expect("plain values");
    weights::save(path, &tensors, HashMap::from([(STANDING.to_string(), standing)]))
}

/// Reads a checkpoint into a fresh model and optimiser.
///
/// # Errors
/// A sentence: the file is damaged or belongs to another model. It is never skipped silently.
pub fn load(
    path: &Path,
    mut model: Model,
    optimiser: AdamW,
) -> Result<(Model, AdamW, Standing), WeightsError> {
    let damaged = |reason: &str| WeightsError::Read {
        path: path.display().to_string(),
        reason: format!("{reason}; remove it to start the run again"),
    };
    let (tensors, notes) = weights::load(path).map_err(|error| match error {
        WeightsError::Read { reason, .. } => damaged(&reason),
        other => other,
    })?;
    let standing = notes.get(STANDING).ok_or_else(|| damaged("no standing in it"))?;
    let standing: Standing =
        serde_json::from_str(standing).map_err(|error| damaged(&error.to_string()))?;
    let (parameters, moments): (Weights, Weights) =
        tensors.into_iter().partition(|(name, _)| name.starts_with(MODEL));
    let strip = |(name, tensor): (String, _)| (name[MODEL.len()..].to_string(), tensor);
    let parameters = parameters.into_iter().map(strip).collect();
    model.weights = weights::into_module(model.weights, parameters)
        .map_err(|error| damaged(&error.to_string()))?;
    let steps = i32::try_from(standing.step).map_err(|_| damaged("an impossible step"))?;
    let optimiser = optimiser
        .with_state(steps, moments, &model.device().clone().inner())
        .ok_or_else(|| damaged("moments are missing"))?;
    Ok((model, optimiser, standing))
}
