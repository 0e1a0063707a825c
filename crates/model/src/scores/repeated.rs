//! [`Repeated`]: a score that was taken several times.

use serde::{Deserialize, Serialize};

use super::error::ScoreError;

/// The mean of a score over repeats, and half the width of its 95 % interval.
///
/// The interval holds what differs between repeats: the draws of motions, pairs and pools. It does not
/// hold the choice of the test clips, nor the evaluator.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Repeated {
    pub mean: f64,
    /// 1.96 s / √n, with the unbiased deviation s of the repeats; 0 for a single one.
    pub half_width: f64,
    pub repeats: usize,
}

impl Repeated {
    /// Those of one score or more.
    ///
    /// # Errors
    /// [`ScoreError::TooFew`].
    pub fn of(scores: &[f64]) -> Result<Self, ScoreError> {
        let repeats = scores.len();
        ScoreError::unless_enough("an interval", "repeats", 1, repeats)?;
        let n = repeats as f64;
        let mean = scores.iter().sum::<f64>() / n;
        let squares: f64 = scores.iter().map(|score| (score - mean).powi(2)).sum();
        let variance = squares / (n - 1.0).max(1.0);
        Ok(Self { mean, half_width: 1.96 * (variance / n).sqrt(), repeats })
    }

    /// `0.371 ± 0.006`, with so many digits after the point.
    pub fn shown(&self, digits: usize) -> String {
        format!("{:.digits$} ± {:.digits$}", self.mean, self.half_width)
    }

    /// Whether it lies above `other` with both intervals apart.
    pub fn is_above(&self, other: &Self) -> bool {
        self.mean - self.half_width > other.mean + other.half_width
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_is_that_of_a_mean() {
        let four = Repeated::of(&[1.0, 2.0, 3.0, 4.0]).unwrap();
        assert_eq!((four.mean, four.repeats), (2.5, 4));
        assert!((four.half_width - 1.96 * (5.0f64 / 3.0 / 4.0).sqrt()).abs() < 1e-12);
        assert_eq!(Repeated::of(&[7.0]).unwrap().half_width, 0.0);
        assert!(Repeated::of(&[]).is_err());
    }

    #[test]
    fn intervals_that_overlap_decide_nothing() {
        let score = |mean, half_width| Repeated { mean, half_width, repeats: 20 };
        assert!(score(2.0, 0.4).is_above(&score(1.0, 0.5)));
        assert!(!score(2.0, 0.6).is_above(&score(1.0, 0.5)));
        assert!(!score(1.0, 0.1).is_above(&score(2.0, 0.1)));
    }
}
