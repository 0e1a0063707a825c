//! How different motions are: of all texts, and of one text.

use rand_chacha::ChaCha8Rng;

use super::embeddings::{Embeddings, distance};
use super::error::ScoreError;
use crate::learn::params::distinct;

/// Pairs of motions in published tables, and fewer where there are no more motions than that.
const PAIRS: usize = 300;
const FEW_PAIRS: usize = 100;

/// Pairs of motions of one text in published tables.
const PAIRS_OF_A_TEXT: usize = 10;

/// Diversity: the mean distance of 300 pairs of motions, of 100 where there are no more than 300, of all
/// where there are fewer. Each side of the pairs is drawn without replacement, so that a motion may be
/// beside itself, as in the published protocol.
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
    use rand_chacha::rand_core::SeedableRng;

    use super::*;

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
