//! What several codebooks keep, as the state of one quantizer: each under its number.

use serde_json::Value;

use super::Quantizer;
use crate::learn::{LearnerState, LoadedState};

/// The states of `parts` as one, with `note` beside theirs.
pub fn keep<'a>(
    parts: impl Iterator<Item = &'a (dyn Quantizer + 'static)>,
    note: Value,
) -> LearnerState {
    let mut all = LearnerState::default();
    let mut notes = Vec::new();
    for (i, part) in parts.enumerate() {
        let LearnerState { note, tensors } = part.keep();
        notes.push(note);
        all.tensors.extend(tensors.into_iter().map(|(name, x)| (format!("{i}.{name}"), x)));
    }
    all.note = serde_json::json!({ PARTS: notes, OWN: note });
    all
}

/// Gives each part its own of what [`keep`] gave, and returns the note; `None` where it is not that.
pub fn resume<'a>(
    parts: impl Iterator<Item = &'a mut (dyn Quantizer + 'static)>,
    mut saved: LoadedState,
) -> Option<Value> {
    for (i, part) in parts.enumerate() {
        let prefix = format!("{i}.");
        let own = saved.tensors.iter().filter_map(|(name, tensor)| {
            Some((name.strip_prefix(&prefix)?.to_string(), tensor.clone()))
        });
        let tensors = own.collect();
        let note = saved.note[PARTS].get_mut(i)?.take();
        part.resume(LoadedState { note, tensors })?;
    }
    Some(saved.note[OWN].take())
}

const PARTS: &str = "parts";
const OWN: &str = "own";
