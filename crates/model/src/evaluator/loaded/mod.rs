//! Evaluators that others trained, in the files that `experiments/convert_evaluator.py` makes: those behind
//! published tables (Guo et al. 2022, Meng et al. 2024).

use std::path::Path;

use burn::tensor::Device;
use serde::Deserialize;

use super::EvaluatorError;
use super::codec::{Evaluator, SPEC, WORDS};
use crate::data::MotionSource;
use crate::files::{ANY, read_regular};
use crate::learn::{described, weights};
use crate::scores::published::EVALUATORS;
use crate::spec::{
    EvaluatorFeatures, EvaluatorSection, EvaluatorSpec, LoadedSpec, MatchingSpec, Mismatches,
    NetworksSpec,
};

/// Frames a second of HumanML3D.
const FPS: f64 = 20.0;

/// Words of a caption, with its start and its end.
const MAX_WORDS: usize = 22;

/// Frames that motions are filled up to.
const WINDOW: usize = 196;

/// What the script writes beside the weights; it also says what they were made of.
#[derive(Deserialize)]
struct Converted {
    name: String,
    /// Features of a frame that the networks see.
    features: usize,
    width: usize,
    dim: usize,
    word_dim: usize,
}

/// The evaluator in a folder of converted files.
///
/// # Errors
/// A file is missing, or describes no such evaluator.
pub fn spec_of(folder: &Path) -> Result<EvaluatorSpec, EvaluatorError> {
    let fails = |problem: String| EvaluatorError::NotConverted {
        folder: folder.display().to_string(),
        problem,
    };
    let read = |name: &str| {
        read_regular(&folder.join(name), ANY).map_err(|error| fails(format!("{name}: {error}")))
    };
    let text = read(SPEC)?;
    let found: Converted =
        serde_json::from_slice(&text).map_err(|error| fails(format!("{SPEC}: {error}")))?;
    let mut digest = blake3::Hasher::new();
    digest.update(&text).update(&read(WORDS)?).update(&read(described::WEIGHTS)?);
    let spec = found.spec(digest.finalize().to_hex().to_string()).map_err(fails)?;
    match spec.problems().first() {
        Some(key) => Err(fails(format!("{} {}", key.field, key.problem))),
        None => Ok(spec),
    }
}

impl Converted {
    fn spec(self, digest: String) -> Result<EvaluatorSpec, String> {
        let Self { name, features, width, dim, word_dim } = self;
        let names = EVALUATORS.map(|(name, _)| name);
        if !names.contains(&&*name) {
            let names = names.join(", ");
            return Err(format!("`{name}` is no evaluator of published tables: {names}"));
        }
        let representation = match features {
            259 => EvaluatorFeatures::NoContacts,
            67 => EvaluatorFeatures::Meng67,
            _ => return Err(format!("its networks see {features} features, not 259 or 67")),
        };
        let shifted = MatchingSpec { width, mismatches: Mismatches::Shifted, ..Default::default() };
        Ok(EvaluatorSpec {
            networks: NetworksSpec::Matching(shifted),
            representation,
            corrupted: 0.0,
            dim,
            window: WINDOW,
            word_dim,
            max_words: MAX_WORDS,
            loaded: Some(LoadedSpec { name, digest }),
            ..EvaluatorSection::default().spec()
        })
    }
}

impl Evaluator {
    /// Reads converted files, for use on `device` with the captions of the test split of `source`.
    ///
    /// # Errors
    /// As [`spec_of`]; a tensor is missing or of another shape; the data have another rate.
    pub fn converted(
        folder: &Path,
        source: &dyn MotionSource,
        device: &Device,
    ) -> Result<Self, EvaluatorError> {
        let (spec, fps) = (spec_of(folder)?, f64::from(source.fps()));
        if fps != FPS {
            return Err(EvaluatorError::Rate { found: fps, wanted: FPS });
        }
        let (tensors, _) = weights::load(&folder.join(described::WEIGHTS))?;
        let mut evaluator = Self::of(folder, spec, fps, tensors, device)?;
        evaluator.read_captions(source);
        Ok(evaluator)
    }
}

#[cfg(test)]
mod tests;
