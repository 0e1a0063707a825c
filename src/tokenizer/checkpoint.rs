//! Checkpoints of a tokenizer in training: all that it needs to go on with the same bits, in one
//! file.

use std::collections::HashMap;
use std::path::Path;
use std::time::Duration;

use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::module::TokenizerModule;
use super::vq::QuantizerState;
use crate::train::adamw::AdamW;
use crate::train::weights::{self, HostTensor, Source, Weights, WeightsError};

/// Where a tokenizer's training leaves checkpoints, and how often.
///
/// They never change the result; the file is removed by the caller, after the tokenizer is whole.
#[derive(Clone, Copy, Debug)]
pub struct Checkpoints<'a> {
    pub path: &'a Path,
    pub every: Duration,
}

/// A training as a checkpoint holds it.
pub(super) struct Moment {
    /// Steps done.
    pub step: usize,
    pub module: TokenizerModule,
    pub optimiser: AdamW,
    /// Draws the windows of a batch.
    pub windows: ChaCha8Rng,
}

/// What is no tensor.
#[derive(Serialize, Deserialize)]
struct Standing {
    step: usize,
    /// Numbers drawn for windows, and by the quantizer; as text, since they have 68 bits.
    windows_drawn: String,
    quantizer_drawn: Option<String>,
}

const STANDING: &str = "standing";
const MODULE: &str = "module.";
const SUMS: &str = "quantizer.sums";
const COUNTS: &str = "quantizer.counts";

/// Writes a checkpoint whole, by rename, in place of the last one.
pub(super) fn save(path: &Path, moment: &Moment) -> Result<(), WeightsError> {
    let (_, mut tensors) = moment.optimiser.state();
    let parameters = weights::of_module(&moment.module);
    tensors
        .extend(parameters.into_iter().map(|(name, tensor)| (format!("{MODULE}{name}"), tensor)));
    let quantizer = moment.module.quantizer_state();
    if let Some(state) = &quantizer {
        tensors.insert(SUMS.into(), row(&state.sums));
        tensors.insert(COUNTS.into(), row(&state.counts));
    }
    let standing = Standing {
        step: moment.step,
        windows_drawn: moment.windows.get_word_pos().to_string(),
        quantizer_drawn: quantizer.map(|state| state.drawn.to_string()),
    };
    let standing = serde_json::to_string(&standing).expect("plain values");
    weights::save(path, &tensors, HashMap::from([(STANDING.to_string(), standing)]))
}

fn row(values: &[f32]) -> Source {
    Source::Host(HostTensor { shape: vec![values.len()], values: values.to_vec() })
}

/// Reads a checkpoint into a fresh training.
///
/// # Errors
/// A sentence: the file is damaged or belongs to another tokenizer. It is never skipped silently.
pub(super) fn load(path: &Path, fresh: Moment) -> Result<Moment, WeightsError> {
    let (mut tensors, notes) = weights::load(path).map_err(|error| match error {
        WeightsError::Read { reason, .. } => damaged(path, &reason),
        other => other,
    })?;
    let standing = notes.get(STANDING).ok_or_else(|| damaged(path, "no standing in it"))?;
    let standing: Standing =
        serde_json::from_str(standing).map_err(|error| damaged(path, &error.to_string()))?;
    let quantizer = quantizer(&mut tensors, standing.quantizer_drawn.as_deref());
    moment(tensors, &standing, quantizer, fresh)
        .ok_or_else(|| damaged(path, "parameters or moments are missing"))
}

fn damaged(path: &Path, reason: &str) -> WeightsError {
    WeightsError::Read {
        path: path.display().to_string(),
        reason: format!("{reason}; remove it to start the tokenizer again"),
    }
}

/// The quantizer's own state; none where it has none, or where a part is missing.
fn quantizer(tensors: &mut Weights, drawn: Option<&str>) -> Option<QuantizerState> {
    let (sums, counts) = (tensors.remove(SUMS), tensors.remove(COUNTS));
    let drawn = drawn?.parse().ok()?;
    Some(QuantizerState { sums: sums?.values, counts: counts?.values, drawn })
}

fn moment(
    tensors: Weights,
    standing: &Standing,
    quantizer: Option<QuantizerState>,
    mut fresh: Moment,
) -> Option<Moment> {
    let (parameters, moments): (Weights, Weights) =
        tensors.into_iter().partition(|(name, _)| name.starts_with(MODULE));
    let strip = |(name, tensor): (String, _)| (name[MODULE.len()..].to_string(), tensor);
    let parameters = parameters.into_iter().map(strip).collect();
    let device = fresh.module.device().inner();
    let mut module = weights::into_module(fresh.module, parameters).ok()?;
    if standing.quantizer_drawn.is_some() {
        module.resume_quantizer(quantizer?);
    }
    fresh.windows.set_word_pos(standing.windows_drawn.parse().ok()?);
    let steps = i32::try_from(standing.step).ok()?;
    let optimiser = fresh.optimiser.with_state(steps, moments, &device)?;
    Some(Moment { step: standing.step, module, optimiser, windows: fresh.windows })
}
