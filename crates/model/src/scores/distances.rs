//! Distances of embeddings: of two sets (FID), of motions of all texts (diversity), and of one text (MultiModality).

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rand_chacha::ChaCha8Rng;

use super::{Embeddings, ScoreError, distance};
use crate::draws::distinct;

// The Fréchet distance of two sets of embeddings (FID).

/// Mean and unbiased covariance of embeddings.
#[derive(Clone, Debug)]
pub struct Gaussian {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl Gaussian {
    /// Moments of two embeddings or more. With fewer embeddings than dimensions the covariance is singular, but the distance
    /// stays defined.
    ///
    /// # Errors
    /// [`ScoreError::TooFew`].
    pub fn of(embeddings: &Embeddings) -> Result<Self, ScoreError> {
        let (n, dim) = (embeddings.len(), embeddings.dim());
        ScoreError::unless_enough("FID", "motions in each set", 2, n)?;
        let rows = DMatrix::from_fn(n, dim, |row, column| embeddings.row(row)[column]);
        let mean = rows.row_mean().transpose();
        let centred = DMatrix::from_fn(n, dim, |row, column| rows[(row, column)] - mean[column]);
        let covariance = centred.tr_mul(&centred) / (n - 1) as f64;
        Ok(Self { mean, covariance })
    }

    /// |μ₁ − μ₂|² + tr(Σ₁ + Σ₂ − 2 (Σ₁ Σ₂)^½).
    ///
    /// The trace of (Σ₁ Σ₂)^½ is that of (Σ₁^½ Σ₂ Σ₁^½)^½, a root of a symmetric matrix, which singular
    /// covariances have too.
    ///
    /// # Errors
    /// [`ScoreError::Widths`].
    pub fn distance(&self, other: &Self) -> Result<f64, ScoreError> {
        let (left, right) = (self.mean.len(), other.mean.len());
        if left != right {
            return Err(ScoreError::Widths { left, right });
        }
        let shift = (&self.mean - &other.mean).norm_squared();
        let root = root(&self.covariance);
        let product = symmetric(&root * &other.covariance * &root);
        let common: f64 =
            product.symmetric_eigenvalues().iter().map(|value| value.max(0.0).sqrt()).sum();
        let spread = self.covariance.trace() + other.covariance.trace() - 2.0 * common;
        Ok(shift + spread.max(0.0))
    }
}

/// FID of two sets of embeddings.
///
/// Its expectation falls towards its limit as the sets grow, by about dim / n: compare sets of one
/// size.
///
/// # Errors
/// [`ScoreError::TooFew`] and [`ScoreError::Widths`].
pub fn frechet_distance(truth: &Embeddings, made: &Embeddings) -> Result<f64, ScoreError> {
    Gaussian::of(truth)?.distance(&Gaussian::of(made)?)
}

/// The root of a positive semidefinite matrix.
fn root(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let SymmetricEigen { eigenvectors, eigenvalues } = matrix.clone().symmetric_eigen();
    let roots = eigenvalues.map(|value| value.max(0.0).sqrt());
    symmetric(&eigenvectors * DMatrix::from_diagonal(&roots) * eigenvectors.transpose())
}

/// The symmetric part, without what rounding added.
fn symmetric(matrix: DMatrix<f64>) -> DMatrix<f64> {
    (&matrix + matrix.transpose()) * 0.5
}

// How different motions are: of all texts, and of one text.

/// Pairs of motions in published tables, and the number if there are fewer motions.
const PAIRS: usize = 300;
const FEW_PAIRS: usize = 100;

/// Pairs of motions of one text in published tables.
const PAIRS_OF_A_TEXT: usize = 10;

/// Diversity: the mean distance of 300 pairs of motions, of 100 with at most 300 motions, of all with fewer. Each side of
/// the pairs is drawn without replacement, so a motion may be paired with itself, as in the published protocol.
///
/// # Errors
/// [`ScoreError::TooFew`].
pub fn diversity(motions: &Embeddings, rng: &mut ChaCha8Rng) -> Result<f64, ScoreError> {
    let n = motions.len();
    ScoreError::unless_enough("diversity", "motions", 2, n)?;
    let pairs = if n > PAIRS { PAIRS } else { FEW_PAIRS.min(n) };
    let (left, right) = (distinct(n, pairs, rng), distinct(n, pairs, rng));
    Ok(mean_distance(motions, 0, &left, &right))
}

/// MultiModality: the mean distance of ten pairs of the motions of one text, over all texts. `motions`
/// has `n_samples` of each text after one another; the pairs are the same for every text.
///
/// # Errors
/// [`ScoreError::TooFew`] with fewer than two samples, or no text; [`ScoreError::Ragged`] where texts
/// have different numbers of motions.
pub fn multimodality(
    motions: &Embeddings,
    n_samples: usize,
    rng: &mut ChaCha8Rng,
) -> Result<f64, ScoreError> {
    let found = n_samples.min(motions.len());
    ScoreError::unless_enough("MultiModality", "motions of each text", 2, found)?;
    if !motions.len().is_multiple_of(n_samples) {
        return Err(ScoreError::Ragged { values: motions.len(), dim: n_samples });
    }
    let pairs = PAIRS_OF_A_TEXT.min(n_samples);
    let (left, right) = (distinct(n_samples, pairs, rng), distinct(n_samples, pairs, rng));
    let starts = (0..motions.len()).step_by(n_samples);
    let of_text = |start: usize| mean_distance(motions, start, &left, &right);
    Ok(starts.clone().map(of_text).sum::<f64>() / starts.len() as f64)
}

/// The mean distance of pairs of motions, counted from one of them.
fn mean_distance(motions: &Embeddings, start: usize, left: &[usize], right: &[usize]) -> f64 {
    let between =
        |(a, b): (&usize, &usize)| distance(motions.row(start + a), motions.row(start + b));
    left.iter().zip(right).map(between).sum::<f64>() / left.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::rand_core::SeedableRng;

    fn waves(n: usize, dim: usize, scale: f64, shift: f64) -> Embeddings {
        let value = |i: usize| scale * (0.37 * (i * i % 1009) as f64).sin() + shift;
        Embeddings::new((0..n * dim).map(value).collect(), dim).unwrap()
    }

    #[test]
    fn a_set_is_at_no_distance_from_itself_few_or_many() {
        for (n, dim) in [(2, 1), (5, 16), (300, 16)] {
            let set = waves(n, dim, 30.0, 5.0);
            let distance = frechet_distance(&set, &set).unwrap();
            assert!((0.0..1e-6).contains(&distance), "{n} of {dim}: {distance}");
        }
    }

    /// One number each: (μ₁ − μ₂)² + (σ₁ − σ₂)².
    #[test]
    fn one_dimension_is_that_of_the_definition() {
        let a = Embeddings::new(vec![-1.0, 1.0, -1.0, 1.0], 1).unwrap();
        let b = Embeddings::new(vec![0.0, 6.0, 0.0, 6.0], 1).unwrap();
        let deviation = (4.0f64 / 3.0).sqrt();
        let expected = 9.0 + (3.0 * deviation - deviation).powi(2);
        assert!((frechet_distance(&a, &b).unwrap() - expected).abs() < 1e-12);
    }

    #[test]
    fn it_is_symmetric_and_grows_with_the_shift() {
        let (a, b) = (waves(200, 8, 1.0, 0.0), waves(150, 8, 1.5, 0.2));
        let [there, back] = [frechet_distance(&a, &b).unwrap(), frechet_distance(&b, &a).unwrap()];
        assert!((there - back).abs() < 1e-9 * there, "{there} {back}");
        let further = frechet_distance(&a, &waves(150, 8, 1.5, 2.0)).unwrap();
        assert!(further > there);
    }

    #[test]
    fn one_motion_has_none_and_widths_must_agree() {
        let one = waves(1, 4, 1.0, 0.0);
        let error = frechet_distance(&one, &one).unwrap_err().to_string();
        assert!(error.contains("needs 2 motions"), "{error}");
        let error = frechet_distance(&waves(3, 4, 1.0, 0.0), &waves(3, 5, 1.0, 0.0)).unwrap_err();
        assert_eq!(error, ScoreError::Widths { left: 4, right: 5 });
    }

    fn rng(seed: u64) -> ChaCha8Rng {
        ChaCha8Rng::seed_from_u64(seed)
    }

    /// On the mean over draws: each pair of n evenly spaced points with the same chance, self included.
    #[test]
    fn diversity_is_the_mean_distance_of_pairs() {
        let n = 8;
        let points = Embeddings::new((0..n).map(f64::from).collect(), 1).unwrap();
        let drawn: f64 = (0..400).map(|seed| diversity(&points, &mut rng(seed)).unwrap()).sum();
        let n = f64::from(n);
        let expected = (n * n - 1.0) / (3.0 * n);
        assert!((drawn / 400.0 - expected).abs() < 0.06, "{} {expected}", drawn / 400.0);
    }

    #[test]
    fn multimodality_looks_within_a_text_alone() {
        // Two texts a thousand apart, each with three motions one apart.
        let values = vec![0.0, 1.0, 2.0, 1000.0, 1001.0, 1002.0];
        let motions = Embeddings::new(values, 1).unwrap();
        let spread = multimodality(&motions, 3, &mut rng(1)).unwrap();
        assert!((0.0..=2.0).contains(&spread), "{spread}");
        let mean: f64 =
            (0..400).map(|seed| multimodality(&motions, 3, &mut rng(seed)).unwrap()).sum();
        assert!((mean / 400.0 - 8.0 / 9.0).abs() < 0.06, "{}", mean / 400.0);
    }

    #[test]
    fn one_motion_has_no_spread() {
        let one = Embeddings::new(vec![1.0], 1).unwrap();
        assert!(diversity(&one, &mut rng(0)).is_err());
        let error = multimodality(&one, 1, &mut rng(0)).unwrap_err().to_string();
        assert_eq!(error, "MultiModality needs 2 motions of each text or more, there are 1");
        let five = Embeddings::new(vec![0.0; 5], 1).unwrap();
        assert!(multimodality(&five, 2, &mut rng(0)).is_err());
    }
}
