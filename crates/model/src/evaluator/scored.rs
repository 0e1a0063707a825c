//! [`MotionScores`]: motions of captions, scored beside true ones.

use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::error::EvaluatorError;
use super::truth::Embedded;
use crate::learn::params::distinct;
use crate::scores::{
    Embeddings, POOL, Repeated, Retrieval, cosine_score, diversity, frechet_distance, retrieval,
};

/// What motions score, over repeats.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotionScores {
    /// From the true motions.
    pub fid: Repeated,
    /// R@1, R@2 and R@3, in pools of 32.
    pub precision: [Repeated; 3],
    /// MM-Dist.
    pub matching_distance: Repeated,
    /// Mean cosine of a motion and its caption: CLIP-score.
    pub cosine: Repeated,
    pub diversity: Repeated,
}

/// What one set of motions scores.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OneScore {
    pub fid: f64,
    pub precision: [f64; 3],
    pub matching_distance: f64,
    pub cosine: f64,
    pub diversity: f64,
}

impl OneScore {
    /// Motions with their captions, beside true motions; pools and pairs are drawn by `rng`.
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
    /// Those of one set or more.
    ///
    /// # Errors
    /// There is none.
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
