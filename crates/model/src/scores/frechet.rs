//! The Fréchet distance of two sets of embeddings (FID).

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::embeddings::Embeddings;
use super::error::ScoreError;

/// Mean and unbiased covariance of embeddings.
#[derive(Clone, Debug)]
pub struct Gaussian {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl Gaussian {
    /// Those of two embeddings or more. With fewer embeddings than numbers in each the covariance is
    /// singular, and the distance stays defined.
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
    truth.beside(made)?;
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

#[cfg(test)]
mod tests {
    use super::*;

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
}
