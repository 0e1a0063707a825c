//! [`rank_correlation`]: whether two quantities of the same things rise together.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::{Deserialize, Serialize};

use super::error::ScoreError;
use crate::learn::params::below;

/// Draws of the bootstrap.
const DRAWS: usize = 2000;

/// Things below which a rank correlation says nothing.
const LEAST: usize = 5;

/// Spearman's rank correlation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RankCorrelation {
    pub value: f64,
    /// 95 % of 2000 draws of as many things, with replacement.
    pub interval: [f64; 2],
    pub n: usize,
}

/// That of pairs; things that are alike share the mean of their ranks.
///
/// # Errors
/// [`ScoreError::TooFew`] below five pairs.
pub fn rank_correlation(pairs: &[(f64, f64)]) -> Result<RankCorrelation, ScoreError> {
    let n = pairs.len();
    ScoreError::unless_enough("a rank correlation", "runs", LEAST, n)?;
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let draw = |_| spearman(&(0..n).map(|_| pairs[below(&mut rng, n)]).collect::<Vec<_>>());
    let mut drawn: Vec<f64> = (0..DRAWS).map(draw).collect();
    drawn.sort_by(f64::total_cmp);
    let end = |share: f64| drawn[(share * (DRAWS - 1) as f64).round() as usize];
    Ok(RankCorrelation { value: spearman(pairs), interval: [end(0.025), end(0.975)], n })
}

/// The correlation of ranks; 0 where all of a side are alike.
fn spearman(pairs: &[(f64, f64)]) -> f64 {
    let (x, y): (Vec<f64>, Vec<f64>) = pairs.iter().copied().unzip();
    let (x, y) = (ranks(&x), ranks(&y));
    let mean = (pairs.len() + 1) as f64 / 2.0;
    let sum = |a: &[f64], b: &[f64]| -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - mean) * (b - mean)).sum()
    };
    let scale = (sum(&x, &x) * sum(&y, &y)).sqrt();
    if scale == 0.0 { 0.0 } else { sum(&x, &y) / scale }
}

/// Ranks from 1.
fn ranks(values: &[f64]) -> Vec<f64> {
    let rank = |value: &f64| {
        let below = values.iter().filter(|other| *other < value).count();
        let level = values.iter().filter(|other| *other == value).count();
        below as f64 + (level + 1) as f64 / 2.0
    };
    values.iter().map(rank).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_rises_together_has_one_and_what_falls_has_minus_one() {
        let of = |power: i32| {
            let pairs: Vec<_> = (1..9).map(|i| (f64::from(i), f64::from(i).powi(power))).collect();
            rank_correlation(&pairs).unwrap()
        };
        assert_eq!(of(3), RankCorrelation { value: 1.0, interval: [1.0, 1.0], n: 8 });
        assert_eq!(of(-2).value, -1.0);
    }

    /// SciPy's spearmanr of the same numbers.
    #[test]
    fn things_that_are_alike_share_ranks() {
        let pairs = [(1.0, 2.0), (2.0, 2.0), (2.0, 5.0), (4.0, 3.0), (5.0, 9.0), (6.0, 7.0)];
        let found = rank_correlation(&pairs).unwrap();
        assert!((found.value - 0.808_823_529_411_764_7).abs() < 1e-12, "{}", found.value);
        assert!(found.interval[0] < found.value && found.value < found.interval[1]);
        assert!(rank_correlation(&pairs[..4]).is_err());
    }
}
