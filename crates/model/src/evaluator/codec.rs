//! [`Evaluator`]: trained networks with the statistics that motions are normalised by; [`AnyNetworks`]: networks of any
//! kind.

use std::ops::Deref;
use std::path::Path;

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::{Deserialize, Serialize};

use super::EvaluatorError;
use super::matching::MatchingNetworks;
use super::motion_clip::Towers;
use super::seen::{Networks, Rows, Seen, words};
use super::tagged::Vocabulary;
use crate::data::{FeatureStats, MotionSource};
use crate::files::atomic::write_json;
use crate::files::{ANY, FileError, read_regular};
use crate::learn::weights::Weights;
use crate::learn::{described, weights};
use crate::progress::moved;
use crate::scores::Embeddings;
use crate::spec::{EvaluatorSpec, NetworksSpec};

/// Motions and captions that are embedded at once.
const BATCH: usize = 64;

/// Motions and captions into embeddings.
#[derive(Debug)]
pub struct Evaluator {
    networks: AnyNetworks,
    seen: Seen,
    /// Of one that others trained; captions are hashed n-grams without it.
    vocabulary: Option<Vocabulary>,
}

impl Evaluator {
    /// Takes networks as they are after training, without autodiff, on `device`.
    pub(super) fn new(networks: AnyNetworks, seen: Seen) -> Self {
        Self { networks, seen, vocabulary: None }
    }

    /// Its specification.
    pub fn spec(&self) -> &EvaluatorSpec {
        &self.seen.spec
    }

    /// The normalisation of motions.
    pub fn stats(&self) -> &FeatureStats {
        &self.seen.stats
    }

    /// Frames per second of its motions.
    pub fn fps(&self) -> f64 {
        self.seen.fps
    }

    /// Parameters of both networks.
    pub fn n_parameters(&self) -> usize {
        self.networks.num_params()
    }

    /// Vectors of motions, each `[T, 263]` row-major and raw.
    ///
    /// # Errors
    /// A motion of other features, one shorter than a row, or one that holds no finite numbers.
    pub fn motions<'a>(
        &self,
        motions: impl IntoIterator<Item = &'a [f32]>,
    ) -> Result<Embeddings, EvaluatorError> {
        let frames = motions.into_iter().map(|motion| self.seen.first_frames(motion));
        let frames = frames.collect::<Result<Vec<_>, _>>()?;
        let frames: Vec<&[f32]> = frames.iter().map(Vec::as_slice).collect();
        self.embedded(&frames, self.seen.channels(), |rows| self.networks.motions(rows))
    }

    /// Vectors of captions.
    ///
    /// # Errors
    /// The weights hold no finite numbers; the evaluator reads parts of speech, and those of a caption are unknown.
    pub fn captions<'a>(
        &self,
        captions: impl IntoIterator<Item = &'a str>,
    ) -> Result<Embeddings, EvaluatorError> {
        let rows = |caption: &str| match &self.vocabulary {
            None => Ok(words(caption, self.spec())),
            Some(own) => own
                .rows(caption, self.spec().max_words)
                .ok_or_else(|| EvaluatorError::Untagged { caption: caption.to_string() }),
        };
        let words = captions.into_iter().map(rows).collect::<Result<Vec<Vec<f32>>, _>>()?;
        let words: Vec<&[f32]> = words.iter().map(Vec::as_slice).collect();
        self.embedded(&words, self.spec().word_dim, |rows| self.networks.captions(rows))
    }

    fn embedded(
        &self,
        sequences: &[&[f32]],
        channels: usize,
        embed: impl Fn(&Rows) -> Tensor<2>,
    ) -> Result<Embeddings, EvaluatorError> {
        let mut values = Vec::with_capacity(sequences.len() * self.spec().dim);
        for batch in sequences.chunks(BATCH) {
            moved();
            let vectors = embed(&Rows::of(batch.iter().copied(), channels)).into_data();
            values.extend(vectors.iter::<f64>());
        }
        Ok(Embeddings::new(values, self.spec().dim)?)
    }

    /// Writes `weights.safetensors`, then `evaluator.json`, each whole, by rename; before them `words.json` if it has
    /// a vocabulary.
    ///
    /// # Errors
    /// The folder cannot be written to.
    pub fn save(&self, folder: &Path) -> Result<(), EvaluatorError> {
        let mut tensors = weights::of_module(&self.networks);
        weights::insert_stats(&mut tensors, self.stats());
        if let Some(own) = &self.vocabulary {
            own.insert(&mut tensors);
            write_json(&folder.join(WORDS), own.stored())?;
        }
        let saved = Saved { spec: self.spec().clone(), fps: self.fps() };
        Ok(described::save(folder, SPEC, &saved, &tensors)?)
    }

    /// Reads files of [`Evaluator::save`], for use on `device`.
    ///
    /// # Errors
    /// A file is missing or damaged.
    pub fn load(folder: &Path, device: &Device) -> Result<Self, EvaluatorError> {
        let (Saved { spec, fps }, tensors) = described::load(folder, SPEC)?;
        let problem = spec.problems().first().map(|key| format!("{} {}", key.field, key.problem));
        if let Some(problem) = problem.or_else(|| described::no_rate(fps)) {
            return Err(FileError::damaged(&folder.join(SPEC), problem).into());
        }
        Self::of(folder, spec, fps, tensors, device)
    }

    /// Puts together what a folder holds.
    ///
    /// # Errors
    /// A tensor is missing or of another shape; `words.json` is wanted, and is missing or damaged.
    pub(super) fn of(
        folder: &Path,
        spec: EvaluatorSpec,
        fps: f64,
        mut tensors: Weights,
        device: &Device,
    ) -> Result<Self, EvaluatorError> {
        let EvaluatorSpec { networks, dim, word_dim, loaded, .. } = &spec;
        let sizes = serde_json::json!({"networks": networks, "dim": dim, "word_dim": word_dim});
        if let Some(problem) = described::beyond(&sizes, &tensors) {
            return Err(FileError::damaged(&folder.join(SPEC), problem).into());
        }
        let vocabulary = loaded.is_some().then(|| {
            let path = folder.join(WORDS);
            let bytes = read_regular(&path, ANY).map_err(FileError::read(&path))?;
            let words = serde_json::from_slice(&bytes).map_err(|error| error.to_string());
            let own = words.and_then(|words| Vocabulary::take(words, &mut tensors, *word_dim));
            own.map_err(|problem| FileError::damaged(&path, problem))
        });
        let vocabulary = vocabulary.transpose()?;
        let seen = Seen { stats: weights::take_stats(&mut tensors)?, spec, fps };
        let mut unused = ChaCha8Rng::seed_from_u64(0);
        let networks = AnyNetworks::init(&seen.spec, seen.n_features(), &mut unused, device);
        Ok(Self { networks: weights::into_module(networks, tensors)?, seen, vocabulary })
    }

    /// Learns the words and parts of speech of the captions of the test split, if it reads such.
    pub(super) fn read_captions(&mut self, source: &dyn MotionSource) {
        self.vocabulary.iter_mut().for_each(|own| own.read_captions(source));
    }
}

/// The facts of an evaluator, besides weights.
#[derive(Serialize, Deserialize)]
struct Saved {
    spec: EvaluatorSpec,
    fps: f64,
}

/// Its file.
pub(super) const SPEC: &str = "evaluator.json";
/// The words of a vocabulary.
pub(super) const WORDS: &str = "words.json";

// Only [`AnyNetworks::init`] matches on the kind.

/// Networks of any kind, as a module.
#[derive(Module, Debug)]
#[expect(clippy::large_enum_variant, reason = "an evaluator holds one, and never many in a row")]
pub enum AnyNetworks {
    MotionClip(Towers),
    Matching(MatchingNetworks),
}

impl AnyNetworks {
    /// Draws parameters, for motions of `n_features` features a frame.
    pub fn init(
        spec: &EvaluatorSpec,
        n_features: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        match &spec.networks {
            NetworksSpec::MotionClip(sizes) => {
                Self::MotionClip(Towers::init(spec, sizes, n_features, rng, device))
            }
            NetworksSpec::Matching(sizes) => {
                Self::Matching(MatchingNetworks::init(spec, sizes, n_features, rng, device))
            }
        }
    }
}

impl Deref for AnyNetworks {
    type Target = dyn Networks;

    fn deref(&self) -> &Self::Target {
        match self {
            Self::MotionClip(towers) => towers,
            Self::Matching(networks) => networks,
        }
    }
}
