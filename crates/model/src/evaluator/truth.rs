//! [`Truth`]: true clips of the test split and their embeddings; [`MotionScores`]: scores of motions against true
//! ones.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::{Deserialize, Serialize};

use super::EvaluatorError;
use super::codec::Evaluator;
use super::seen::usable;
use crate::data::{MotionSource, Split};
use crate::draws::distinct;
use crate::progress::moved;
use crate::scores::{
    Embeddings, MotionScores, POOL, Repeated, Retrieval, cosine_score, diversity, frechet_distance,
    retrieval,
};

/// Test clips that are taken, at most.
const MOST_CLIPS: usize = 2048;

/// The seed of their order, and of their draw if there are more.
const SEED: u64 = 0;

/// True clips, each with one of its captions, in a random order that is always the same.
pub struct Truth {
    /// `[T, 263]` each, raw.
    pub features: Vec<Vec<f32>>,
    /// One caption of each clip.
    pub captions: Vec<String>,
    /// All captions of each clip.
    pub all_captions: Vec<Vec<String>>,
    /// Embeddings of the clips and of their captions.
    pub embedded: Embedded,
}

/// Motions and their captions, embedded.
#[derive(Clone, Debug, PartialEq)]
pub struct Embedded {
    pub motions: Embeddings,
    pub captions: Embeddings,
}

impl Truth {
    /// Clips of the test split.
    ///
    /// # Errors
    /// The split holds fewer clips than two pools of 32, or one cannot be read.
    pub fn load(evaluator: &Evaluator, source: &dyn MotionSource) -> Result<Self, EvaluatorError> {
        let split = Split::Test;
        let usable = usable(source, split, evaluator.spec(), 2 * POOL)?;
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let (mut features, mut captions, mut all_captions) = (Vec::new(), Vec::new(), Vec::new());
        for clip in distinct(usable.len(), MOST_CLIPS, &mut rng).into_iter().map(|i| usable[i]) {
            moved();
            features.push(source.features(split, clip)?);
            let own = source.captions(split, clip);
            captions.push(own[clip % own.len()].clone());
            all_captions.push(own);
        }
        let embedded = Embedded {
            motions: evaluator.motions(features.iter().map(Vec::as_slice))?,
            captions: evaluator.captions(captions.iter().map(String::as_str))?,
        };
        Ok(Self { features, captions, all_captions, embedded })
    }

    /// The number of clips.
    pub fn n_clips(&self) -> usize {
        self.features.len()
    }
}

impl Embedded {
    /// The pairs of these indices, in this order.
    #[must_use]
    pub fn select(&self, indices: &[usize]) -> Self {
        let [motions, captions] = [&self.motions, &self.captions].map(|all| all.select(indices));
        Self { motions, captions }
    }

    /// The motions, each with the caption of the pair of an index.
    #[must_use]
    pub fn recaptioned(&self, indices: &[usize]) -> Self {
        Self { motions: self.motions.clone(), captions: self.captions.select(indices) }
    }

    /// The captions, with other motions.
    #[must_use]
    pub fn with_motions(&self, motions: Embeddings) -> Self {
        Self { motions, captions: self.captions.clone() }
    }
}

/// `n` things in a new order each time, so many times.
pub fn orders(n: usize, times: usize) -> impl Iterator<Item = Vec<usize>> {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    (0..times).map(move |_| distinct(n, n, &mut rng))
}

// Scores of motions that were made.

/// The scores of one set of motions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OneScore {
    pub fid: f64,
    pub precision: [f64; 3],
    pub matching_distance: f64,
    pub cosine: f64,
    pub diversity: f64,
}

impl OneScore {
    /// Scores motions with captions against true motions; pools and pairs are drawn by `rng`.
    ///
    /// # Errors
    /// There are too few of either.
    pub fn of(
        truth: &Embeddings,
        made: &Embedded,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self, EvaluatorError> {
        let n = made.motions.len();
        let Embedded { motions, captions } = made.select(&distinct(n, n, rng));
        let Retrieval { precision, matching_distance, .. } = retrieval(&captions, &motions, POOL)?;
        Ok(Self {
            fid: frechet_distance(truth, &motions)?,
            precision,
            matching_distance,
            cosine: cosine_score(&captions, &motions)?,
            diversity: diversity(&motions, rng)?,
        })
    }
}

impl MotionScores {
    /// Combines one set or more.
    ///
    /// # Errors
    /// There is no set.
    pub fn of(scores: &[OneScore]) -> Result<Self, EvaluatorError> {
        let repeated =
            |of: fn(&OneScore) -> f64| Repeated::of(&scores.iter().map(of).collect::<Vec<f64>>());
        Ok(Self {
            fid: repeated(|score| score.fid)?,
            precision: [
                repeated(|score| score.precision[0])?,
                repeated(|score| score.precision[1])?,
                repeated(|score| score.precision[2])?,
            ],
            matching_distance: repeated(|score| score.matching_distance)?,
            cosine: repeated(|score| score.cosine)?,
            diversity: repeated(|score| score.diversity)?,
        })
    }
}
