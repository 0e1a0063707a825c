//! A module in a folder: its weights and, in JSON, its description, without which they are nothing.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::weights::{self, Sources, Weights};
use crate::files::atomic::{json, write_bytes};
use crate::files::{FileError, SMALL, read_regular};

/// The weights of a module.
pub const WEIGHTS: &str = "weights.safetensors";
/// The note with the digest of the description.
const DESCRIPTION: &str = "description";

/// Writes `weights.safetensors`, then the description as `name`, each whole, by rename.
///
/// # Errors
/// [`FileError::Write`].
pub fn save(
    folder: &Path,
    name: &str,
    description: &impl Serialize,
    sources: &Sources,
) -> Result<(), FileError> {
    let path = folder.join(name);
    let text = json(description).map_err(FileError::write(&path))?;
    let digest = blake3::hash(text.as_bytes()).to_hex().to_string();
    weights::save(
        &folder.join(WEIGHTS),
        sources,
        BTreeMap::from([(DESCRIPTION.to_string(), digest)]),
    )?;
    write_bytes(&path, text.as_bytes())
}

/// Reads what [`save`] wrote.
///
/// # Errors
/// [`FileError::Read`]; [`FileError::Damaged`] also where the description is that of other weights.
pub fn load<T: DeserializeOwned>(folder: &Path, name: &str) -> Result<(T, Weights), FileError> {
    let path = folder.join(name);
    let text = read_regular(&path, SMALL).map_err(FileError::read(&path))?;
    let description =
        serde_json::from_slice(&text).map_err(|error| FileError::damaged(&path, error))?;
    let (weights, notes) = weights::load(&folder.join(WEIGHTS))?;
    let digest = blake3::hash(&text).to_hex().to_string();
    // Older files have none.
    match notes.get(DESCRIPTION) {
        Some(written) if *written != digest => {
            Err(FileError::damaged(&path, "it is not the description of the weights beside it"))
        }
        _ => Ok((description, weights)),
    }
}

/// Why a number is no rate of frames; `None` if it is one.
pub fn no_rate(fps: f64) -> Option<String> {
    let is_rate = fps.is_finite() && fps > 0.0;
    (!is_rate).then(|| format!("{fps} frames a second are no rate"))
}

/// The first whole number of a description, with its key, that is larger than every dimension of the weights:
/// a model of such a size has other weights, and may not fit into memory.
pub fn beyond(description: &impl Serialize, tensors: &Weights) -> Option<String> {
    let most = tensors.values().flat_map(|tensor| &tensor.shape).max().copied().unwrap_or(0);
    let found = larger("", &serde_json::to_value(description).ok()?, most as u64);
    found.map(|(key, n)| format!("its {key} of {n} is larger than any of its weights"))
}

fn larger(key: &str, value: &Value, most: u64) -> Option<(String, u64)> {
    match value {
        Value::Object(entries) => entries.iter().find_map(|(key, value)| larger(key, value, most)),
        Value::Array(items) => items.iter().find_map(|item| larger(key, item, most)),
        _ => value.as_u64().filter(|n| *n > most).map(|n| (key.to_string(), n)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learn::weights::{HostTensor, Source};

    #[test]
    fn weights_with_the_description_of_others_are_damaged() {
        let folder = tempfile::tempdir().unwrap();
        let tensor = HostTensor { shape: vec![1], values: vec![1.0] };
        let tensors = Sources::from([("gain".into(), Source::Host(tensor))]);
        save(folder.path(), "a.json", &[3, 4], &tensors).unwrap();
        let (description, weights) = load::<Vec<u8>>(folder.path(), "a.json").unwrap();
        assert_eq!((description, weights), (vec![3, 4], weights::on_host(&tensors)));
        for other in ["[]", "[3, 5]", "null", ""] {
            std::fs::write(folder.path().join("a.json"), other).unwrap();
            let error = load::<Vec<u8>>(folder.path(), "a.json").unwrap_err();
            assert!(error.is_damage() && error.path().ends_with("a.json"), "{error}");
        }
    }
}
