//! [`Repeated`]: a score that was taken several times; [`rank_correlation`]: whether two quantities of the same things
//! rise together.

use std::collections::BTreeMap;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::{Deserialize, Serialize};

use super::ScoreError;
use crate::draws::below;

/// The mean of a score over repeats, and half the width of its 95 % interval.
///
/// The interval covers the differences between repeats: the draws of motions, pairs and pools. It does not cover the
/// choice of test clips or the evaluator.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Repeated {
    pub mean: f64,
    /// 1.96 s / √n, with the unbiased deviation s of the repeats; 0 for a single one.
    pub half_width: f64,
    pub repeats: usize,
}

impl Repeated {
    /// From one score or more.
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

/// Draws of the bootstrap.
const DRAWS: usize = 2000;

/// Things below which a rank correlation says nothing.
const LEAST: usize = 5;

/// Spearman's rank correlation, or its like within groups.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RankCorrelation {
    pub value: f64,
    /// 95 % of 2000 draws of as many things of each group, with replacement.
    pub interval: [f64; 2],
    /// Things in groups of two or more.
    pub n: usize,
}

/// That of pairs, each after the key of its group. Groups are ranked apart: what differs between them has no part in
/// it. Things that are alike share the mean of their ranks.
///
/// # Errors
/// [`ScoreError::TooFew`] below five pairs in groups of two or more.
pub fn rank_correlation<K: Ord>(
    pairs: impl IntoIterator<Item = (K, (f64, f64))>,
) -> Result<RankCorrelation, ScoreError> {
    let mut groups: BTreeMap<K, Vec<(f64, f64)>> = BTreeMap::new();
    pairs.into_iter().for_each(|(key, pair)| groups.entry(key).or_default().push(pair));
    let groups: Vec<_> = groups.into_values().collect();
    let n = groups.iter().map(Vec::len).filter(|n| *n > 1).sum();
    ScoreError::unless_enough("a rank correlation", "runs", LEAST, n)?;
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut again = |pairs: &Vec<(f64, f64)>| -> Vec<(f64, f64)> {
        pairs.iter().map(|_| pairs[below(&mut rng, pairs.len())]).collect()
    };
    let draw = |_| spearman(&groups.iter().map(&mut again).collect::<Vec<_>>());
    let mut drawn: Vec<f64> = (0..DRAWS).map(draw).collect();
    drawn.sort_by(f64::total_cmp);
    let end = |share: f64| drawn[(share * (DRAWS - 1) as f64).round() as usize];
    Ok(RankCorrelation { value: spearman(&groups), interval: [end(0.025), end(0.975)], n })
}

/// The correlation of ranks less their group's mean; 0 if all of a side are alike.
fn spearman(groups: &[Vec<(f64, f64)>]) -> f64 {
    let of = |side: fn(&(f64, f64)) -> f64| -> Vec<f64> {
        groups.iter().flat_map(|pairs| ranks(&pairs.iter().map(side).collect::<Vec<_>>())).collect()
    };
    let (x, y) = (of(|pair| pair.0), of(|pair| pair.1));
    let sum = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let scale = (sum(&x, &x) * sum(&y, &y)).sqrt();
    if scale == 0.0 { 0.0 } else { sum(&x, &y) / scale }
}

/// Ranks, of mean 0.
fn ranks(values: &[f64]) -> Vec<f64> {
    let rank = |value: &f64| {
        let below = values.iter().filter(|other| *other < value).count();
        let level = values.iter().filter(|other| *other == value).count();
        below as f64 + (level as f64 - values.len() as f64) / 2.0
    };
    values.iter().map(rank).collect()
}

/// The scores of motions over repeats.
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

    #[test]
    fn what_rises_together_has_one_and_what_falls_has_minus_one() {
        let of = |power: i32| {
            let pair = |i| ((), (f64::from(i), f64::from(i).powi(power)));
            rank_correlation((1..9).map(pair)).unwrap()
        };
        assert_eq!(of(3), RankCorrelation { value: 1.0, interval: [1.0, 1.0], n: 8 });
        assert_eq!(of(-2).value, -1.0);
    }

    /// SciPy's spearmanr of the same numbers.
    #[test]
    fn things_that_are_alike_share_ranks() {
        let pairs = [(1.0, 2.0), (2.0, 2.0), (2.0, 5.0), (4.0, 3.0), (5.0, 9.0), (6.0, 7.0)]
            .map(|pair| ((), pair));
        let found = rank_correlation(pairs).unwrap();
        assert!((found.value - 0.808_823_529_411_764_7).abs() < 1e-12, "{}", found.value);
        assert!(found.interval[0] < found.value && found.value < found.interval[1]);
        assert!(rank_correlation(pairs.into_iter().take(4)).is_err());
    }

    #[test]
    fn what_differs_between_groups_has_no_part() {
        // Groups rise together, and within each one things fall.
        let of =
            |group: i32| move |i| (group, (f64::from(10 * group + i), f64::from(10 * group - i)));
        let pairs = || (0..4).flat_map(|group| (0..5).map(of(group)));
        let across = rank_correlation(pairs().map(|(_, pair)| ((), pair))).unwrap();
        assert!(across.value > 0.5);
        let within = rank_correlation(pairs()).unwrap();
        assert_eq!(within, RankCorrelation { value: -1.0, interval: [-1.0, -1.0], n: 20 });
        let lone = rank_correlation(pairs().enumerate().map(|(key, (_, pair))| (key, pair)));
        assert!(lone.is_err(), "a group of one has no order");
    }
}
