//! [`Seen`]: how an evaluator sees motions.

use super::error::EvaluatorError;
use crate::data::FeatureStats;
use crate::spec::EvaluatorSpec;

/// Normalised values lie within ± this.
const BOUND: f32 = 10.0;

/// How an evaluator sees motions.
#[derive(Clone, Debug)]
pub struct Seen {
    pub spec: EvaluatorSpec,
    /// What is normalised by.
    pub stats: FeatureStats,
}

impl Seen {
    /// That of a spec, with the statistics of its training split.
    pub fn new(spec: &EvaluatorSpec, stats: &FeatureStats) -> Self {
        Self { spec: spec.clone(), stats: stats.clone() }
    }

    /// Features of a frame that are seen.
    pub fn n_features(&self) -> usize {
        self.spec.representation.n_features(self.stats.mean.len())
    }

    /// Numbers of a row.
    pub fn channels(&self) -> usize {
        self.spec.frames() * self.n_features()
    }

    /// Rows of a window.
    pub fn window_rows(&self) -> usize {
        self.spec.window / self.spec.frames()
    }

    /// The first window of rows, all of them where there are fewer.
    pub fn first_window<'a>(&self, rows: &'a [f32]) -> &'a [f32] {
        &rows[..rows.len().min(self.window_rows() * self.channels())]
    }

    /// The rows of a motion, `[T, all features]` row-major and raw; the frames after its last whole row
    /// are left out.
    ///
    /// # Errors
    /// It has other features, or fewer frames than a row.
    pub fn rows(&self, features: &[f32]) -> Result<Vec<f32>, EvaluatorError> {
        let FeatureStats { mean, std } = &self.stats;
        let (all, seen) = (mean.len(), self.n_features());
        if !features.len().is_multiple_of(all) {
            return Err(EvaluatorError::Features { values: features.len(), wanted: all });
        }
        let (n_frames, least) = (features.len() / all, self.spec.frames());
        if n_frames < least {
            return Err(EvaluatorError::TooShort { n_frames, least });
        }
        let whole = n_frames / least * least;
        let standard =
            |((x, mean), std): ((&f32, &f32), &f32)| ((x - mean) / std).clamp(-BOUND, BOUND);
        let frames = features.chunks_exact(all).take(whole);
        let values = frames.flat_map(|frame| frame[..seen].iter().zip(mean).zip(std).map(standard));
        Ok(values.collect())
    }
}
