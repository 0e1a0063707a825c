//! Whether texts find their motions: R-precision, matching distance, cosine score.

use serde::{Deserialize, Serialize};

use super::{Embeddings, ScoreError, distance};

/// Motions that a text chooses among, in every published table.
pub const POOL: usize = 32;

/// Retrieval of motions by their texts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Retrieval {
    /// R-precision: the share of texts whose own motion is among the nearest 1, 2 and 3 of the pool.
    pub precision: [f64; 3],
    /// MM-Dist: the mean distance of a text and its motion.
    pub matching_distance: f64,
    /// Texts that were asked: whole pools.
    pub n_texts: usize,
}

/// R-precision and matching distance of texts and their motions, in consecutive pools of `pool`; a partial pool is left
/// out, as in the published protocol. Shuffle the pairs before.
///
/// Motions at the same distance are in random order, and the expected value is counted: an evaluator with equal
/// embeddings gets 1 / `pool`.
///
/// # Errors
/// [`ScoreError::TooFew`] if no pool is full, [`ScoreError::Unpaired`] and [`ScoreError::Widths`].
pub fn retrieval(
    texts: &Embeddings,
    motions: &Embeddings,
    pool: usize,
) -> Result<Retrieval, ScoreError> {
    texts.paired_with(motions)?;
    let found = if pool == 0 { 0 } else { texts.len() };
    ScoreError::unless_enough("R-precision", "pairs of text and motion", pool.max(1), found)?;
    let n_texts = found / pool * pool;
    let (mut hits, mut matching) = ([0.0; 3], 0.0);
    for text in 0..n_texts {
        let first = text / pool * pool;
        let to = |motion: usize| distance(texts.row(text), motions.row(motion));
        let own = to(text);
        let distances: Vec<f64> = (first..first + pool).map(to).collect();
        let nearer = distances.iter().filter(|other| **other < own).count();
        let level = distances.iter().filter(|other| **other == own).count();
        for (k, hits) in hits.iter_mut().enumerate() {
            *hits += share_within(k + 1, nearer, level);
        }
        matching += own;
    }
    let n = n_texts as f64;
    Ok(Retrieval { precision: hits.map(|hits| hits / n), matching_distance: matching / n, n_texts })
}

/// Probability that one of `level` tied items after `nearer` others is among the first `k`.
fn share_within(k: usize, nearer: usize, level: usize) -> f64 {
    (k.saturating_sub(nearer) as f64 / level as f64).min(1.0)
}

/// The mean cosine of texts and their motions (MARDM's and LG-Tok's CLIP-score); 0 for a vector of
/// zeros.
///
/// # Errors
/// [`ScoreError::TooFew`] without a pair, [`ScoreError::Unpaired`] and [`ScoreError::Widths`].
pub fn cosine_score(texts: &Embeddings, motions: &Embeddings) -> Result<f64, ScoreError> {
    texts.paired_with(motions)?;
    let n = texts.len();
    ScoreError::unless_enough("the cosine score", "pairs of text and motion", 1, n)?;
    let cosines = texts.rows().zip(motions.rows()).map(|(text, motion)| cosine(text, motion));
    Ok(cosines.sum::<f64>() / n as f64)
}

fn cosine(a: &[f64], b: &[f64]) -> f64 {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let norms = (dot(a, a) * dot(b, b)).sqrt();
    if norms == 0.0 { 0.0 } else { dot(a, b) / norms }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(values: &[f64]) -> Embeddings {
        Embeddings::new(values.to_vec(), 1).unwrap()
    }

    /// One motion lies nearer to text 0 than its own, two to text 1, none to text 2, two to text 3.
    #[test]
    fn ranks_are_counted_within_a_pool() {
        let (texts, motions) = (line(&[0.0, 1.2, 9.0, 5.0]), line(&[2.0, 7.0, 9.5, 1.0]));
        let found = retrieval(&texts, &motions, 4).unwrap();
        let ranks = [2, 3, 1, 3];
        let share = |k: usize| ranks.iter().filter(|rank| **rank <= k).count() as f64 / 4.0;
        assert_eq!(found.precision, [share(1), share(2), share(3)]);
        assert!((found.matching_distance - (2.0 + 5.8 + 0.5 + 4.0) / 4.0).abs() < 1e-12);
        let pairs = retrieval(&texts, &motions, 3).unwrap();
        assert_eq!(pairs.n_texts, 3, "the fourth pair fills no pool");
    }

    #[test]
    fn motions_that_are_all_alike_are_found_by_chance() {
        let found = retrieval(&line(&[0.5; 64]), &line(&[0.0; 64]), POOL).unwrap();
        let expected = [1.0, 2.0, 3.0].map(|k| k / 32.0);
        assert!(found.precision.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12));
    }

    #[test]
    fn too_few_and_unpaired_are_refused() {
        let few = retrieval(&line(&[0.0; 31]), &line(&[0.0; 31]), POOL).unwrap_err().to_string();
        assert_eq!(few, "R-precision needs 32 pairs of text and motion or more, there are 31");
        let error = retrieval(&line(&[0.0; 4]), &line(&[0.0; 5]), 2).unwrap_err();
        assert_eq!(error, ScoreError::Unpaired { texts: 4, motions: 5 });
        assert!(retrieval(&line(&[0.0]), &line(&[0.0]), 0).is_err());
        assert!(cosine_score(&line(&[]), &line(&[])).is_err());
    }

    #[test]
    fn cosines_are_those_of_the_pairs() {
        let texts = Embeddings::new(vec![1.0, 0.0, 0.0, 2.0, 3.0, 3.0], 2).unwrap();
        let motions = Embeddings::new(vec![5.0, 0.0, 1.0, 0.0, 0.0, 0.0], 2).unwrap();
        assert!((cosine_score(&texts, &motions).unwrap() - 1.0 / 3.0).abs() < 1e-12);
    }
}
