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
use crate::data::FeatureStats;
use crate::files::FileError;
use crate::learn::{described, weights};
use crate::scores::Embeddings;
use crate::spec::{EvaluatorSpec, NetworksSpec};

/// Motions and captions that are embedded at once.
const BATCH: usize = 64;

/// Motions and captions into embeddings.
#[derive(Debug)]
pub struct Evaluator {
    networks: AnyNetworks,
    seen: Seen,
}

impl Evaluator {
    /// Takes networks as they are after training, without autodiff, on `device`.
    pub(super) fn new(networks: AnyNetworks, seen: Seen) -> Self {
        Self { networks, seen }
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
    /// The weights hold no finite numbers.
    pub fn captions<'a>(
        &self,
        captions: impl IntoIterator<Item = &'a str>,
    ) -> Result<Embeddings, EvaluatorError> {
        let words: Vec<Vec<f32>> =
            captions.into_iter().map(|caption| words(caption, self.spec())).collect();
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
            let vectors = embed(&Rows::of(batch.iter().copied(), channels)).into_data();
            values.extend(vectors.iter::<f64>());
        }
        Ok(Embeddings::new(values, self.spec().dim)?)
    }

    /// Writes `weights.safetensors`, then `evaluator.json`, each whole, by rename.
    ///
    /// # Errors
    /// The folder cannot be written to.
    pub fn save(&self, folder: &Path) -> Result<(), EvaluatorError> {
        let mut tensors = weights::of_module(&self.networks);
        weights::insert_stats(&mut tensors, self.stats());
        let saved = Saved { spec: self.spec().clone(), fps: self.fps() };
        Ok(described::save(folder, SPEC, &saved, &tensors)?)
    }

    /// Reads files of [`Evaluator::save`], for use on `device`.
    ///
    /// # Errors
    /// A file is missing or damaged.
    pub fn load(folder: &Path, device: &Device) -> Result<Self, EvaluatorError> {
        let (Saved { spec, fps }, mut tensors) = described::load(folder, SPEC)?;
        let problem = spec.problems().first().map(|key| format!("{} {}", key.field, key.problem));
        let sizes = serde_json::json!({
            "networks": spec.networks, "dim": spec.dim, "word_dim": spec.word_dim
        });
        let problem = problem.or_else(|| described::beyond(&sizes, &tensors));
        if let Some(problem) = problem.or_else(|| described::no_rate(fps)) {
            return Err(FileError::damaged(&folder.join(SPEC), problem).into());
        }
        let seen = Seen { spec, stats: weights::take_stats(&mut tensors)?, fps };
        let mut unused = ChaCha8Rng::seed_from_u64(0);
        let networks = AnyNetworks::init(&seen.spec, seen.n_features(), &mut unused, device);
        Ok(Self::new(weights::into_module(networks, tensors)?, seen))
    }
}

/// The facts of an evaluator, besides weights.
#[derive(Serialize, Deserialize)]
struct Saved {
    spec: EvaluatorSpec,
    fps: f64,
}

const SPEC: &str = "evaluator.json";

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
