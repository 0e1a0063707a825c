//! Scores of motions: distance between sets of embeddings, retrieval of motions by texts, diversity, and physical
//! statistics without embeddings.
//!
//! Embeddings come from an evaluator; only scores by the same evaluator can be compared.
//!
//! # Example
//!
//! ```
//! use isoflop_model::scores::{Embeddings, frechet_distance};
//!
//! let truth = Embeddings::new(vec![0.0, 1.0, 2.0, 3.0], 1)?;
//! let moved = Embeddings::new(vec![2.0, 3.0, 4.0, 5.0], 1)?;
//! let fid = frechet_distance(&truth, &moved)?;
//! assert!((fid - 4.0).abs() < 1e-9, "the square of the step: {fid}");
//! # Ok::<(), isoflop_model::scores::ScoreError>(())
//! ```

mod distances;
mod physics;
pub mod published;
mod retrieval;
mod statistics;

pub use distances::{Gaussian, diversity, frechet_distance, multimodality};
#[cfg(feature = "train")]
pub(crate) use physics::jerk;
pub use physics::{Physics, physics};
pub use retrieval::{POOL, Retrieval, cosine_score, retrieval};
pub use statistics::{MotionScores, RankCorrelation, Repeated, rank_correlation};

/// Vectors of one width, `[n, dim]` row-major, all finite.
#[derive(Clone, Debug, PartialEq)]
pub struct Embeddings {
    values: Vec<f64>,
    dim: usize,
}

impl Embeddings {
    /// Rows of `dim` numbers.
    ///
    /// # Errors
    /// [`ScoreError::Ragged`] and [`ScoreError::NotFinite`].
    pub fn new(values: Vec<f64>, dim: usize) -> Result<Self, ScoreError> {
        if dim == 0 || !values.len().is_multiple_of(dim) {
            return Err(ScoreError::Ragged { values: values.len(), dim });
        }
        if let Some(at) = values.iter().position(|value| !value.is_finite()) {
            return Err(ScoreError::NotFinite { row: at / dim });
        }
        Ok(Self { values, dim })
    }

    /// The number of embeddings.
    pub fn len(&self) -> usize {
        self.values.len() / self.dim
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Numbers of each.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// One of them.
    pub fn row(&self, index: usize) -> &[f64] {
        &self.values[index * self.dim..(index + 1) * self.dim]
    }

    /// All of them.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.values.chunks_exact(self.dim)
    }

    /// The embeddings of these indices, in this order.
    #[must_use]
    pub fn select(&self, indices: &[usize]) -> Self {
        let values = indices.iter().flat_map(|&index| self.row(index)).copied().collect();
        Self { values, dim: self.dim }
    }

    /// Whether each has a partner of its width in `motions`.
    fn paired_with(&self, motions: &Self) -> Result<(), ScoreError> {
        let (left, right) = (self.dim, motions.dim);
        if left != right {
            return Err(ScoreError::Widths { left, right });
        }
        let (texts, motions) = (self.len(), motions.len());
        if texts == motions { Ok(()) } else { Err(ScoreError::Unpaired { texts, motions }) }
    }
}

/// The Euclidean distance of two vectors.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// Why embeddings or motions have no score.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ScoreError {
    /// Values that are not rows of one width.
    #[error("{values} values are not rows of {dim} numbers each")]
    Ragged { values: usize, dim: usize },
    /// A value that is no number.
    #[error("embedding {row} holds a value that is no finite number")]
    NotFinite { row: usize },
    /// Two sets of different widths.
    #[error("embeddings of {left} and of {right} numbers come from different evaluators")]
    Widths { left: usize, right: usize },
    /// Pairs of which one half is missing.
    #[error("{texts} texts and {motions} motions make no pairs: give one motion a text")]
    Unpaired { texts: usize, motions: usize },
    /// Too few to say anything.
    #[error("{score} needs {least} {what} or more, there are {found}")]
    TooFew { score: &'static str, what: &'static str, least: usize, found: usize },
}

impl ScoreError {
    /// Whether there are as many things as a score needs.
    fn unless_enough(
        score: &'static str,
        what: &'static str,
        least: usize,
        found: usize,
    ) -> Result<(), Self> {
        if found >= least { Ok(()) } else { Err(Self::TooFew { score, what, least, found }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_of_one_width_and_finite() {
        let ragged = Embeddings::new(vec![0.0; 7], 3).unwrap_err();
        assert_eq!(ragged, ScoreError::Ragged { values: 7, dim: 3 });
        assert!(Embeddings::new(Vec::new(), 0).is_err());
        let values = vec![0.0, 1.0, 2.0, 3.0, f64::NAN, 5.0];
        assert_eq!(Embeddings::new(values, 3), Err(ScoreError::NotFinite { row: 1 }));
    }

    #[test]
    fn rows_are_selected_in_order() {
        let all = Embeddings::new((0..6).map(f64::from).collect(), 2).unwrap();
        assert_eq!(all.select(&[2, 0]).rows().collect::<Vec<_>>(), [[4.0, 5.0], [0.0, 1.0]]);
    }
}
