//! Levels of a grid, continued by the grid's own ratio.

use crate::laws::maths::stats::distinct;
use crate::laws::minima::grid::{Grid, WIDEST_STEP};

/// The ratio of neighbouring levels where a sweep shows none.
const DEFAULT_RATIO: f64 = 2.0;
/// Models that can be built lie off the sizes that are asked for.
const MARGIN: f64 = 0.88;

/// The sweep's own ratios of neighbouring levels, where it has them.
pub(in crate::laws) struct Spacing {
    size: Option<f64>,
    vocab: Option<f64>,
}

impl Spacing {
    /// The first ratios that any budget shows.
    pub fn of(grids: &[Grid]) -> Self {
        Self {
            size: grids.iter().find_map(|grid| median_ratio(&grid.size_levels())),
            vocab: grids.iter().find_map(|grid| median_ratio(&grid.vocabularies())),
        }
    }

    /// The ratio of these sizes; else the sweep's; else 2; no wider than a minimum between two may have.
    pub fn size_ratio(&self, sizes: &[f64]) -> f64 {
        median_ratio(sizes).or(self.size).unwrap_or(DEFAULT_RATIO).min(MARGIN * WIDEST_STEP)
    }

    /// The ratio of these vocabularies; else the sweep's; else 2.
    pub fn vocab_ratio(&self, vocabularies: &[f64]) -> f64 {
        median_ratio(vocabularies).or(self.vocab).unwrap_or(DEFAULT_RATIO)
    }
}

/// The median ratio of neighbours, the upper one of an even number; none for fewer than two levels.
pub(in crate::laws) fn median_ratio(levels: &[f64]) -> Option<f64> {
    let sorted = distinct(levels.iter().copied());
    let mut ratios: Vec<f64> = sorted.windows(2).map(|pair| pair[1] / pair[0]).collect();
    ratios.sort_by(f64::total_cmp);
    ratios.get(ratios.len() / 2).copied()
}

/// `n` levels past the highest or the lowest of rising ones, in rising order.
pub(in crate::laws) fn beyond(levels: &[f64], upwards: bool, ratio: f64, n: usize) -> Vec<f64> {
    let step = if upwards { ratio } else { 1.0 / ratio };
    let end = if upwards { levels.last() } else { levels.first() };
    let new = end.map(|end| (1..=n).map(move |i| end * step.powi(i as i32)));
    distinct(new.into_iter().flatten())
}

/// Rising levels filled up to `n` by turns above and below; one level so becomes the centre.
pub(in crate::laws) fn around(levels: &[f64], ratio: f64, n: usize) -> Vec<f64> {
    let mut all = levels.to_vec();
    while let (Some(first), Some(last)) = (all.first(), all.last())
        && all.len() < n
    {
        let upwards = (all.len() - levels.len()).is_multiple_of(2);
        let (at, new) = if upwards { (all.len(), last * ratio) } else { (0, first / ratio) };
        all.insert(at, new);
    }
    all
}

impl Grid {
    /// The sizes tried, rising.
    pub fn size_levels(&self) -> Vec<f64> {
        distinct(self.sizes.iter().map(|size| size.best.params_nonvocab))
    }

    /// The vocabularies tried, rising; none where no cell has one.
    pub fn vocabularies(&self) -> Vec<f64> {
        distinct(self.cells.iter().map(|cell| cell.n_vocab).filter(|v| *v > 0.0))
    }

    /// Runs of a cell, rounded.
    pub fn runs_per_cell(&self) -> usize {
        (self.n_runs as f64 / self.cells.len() as f64).round().max(1.0) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_continue_by_their_own_ratio() {
        let ratio = median_ratio(&[1.0, 2.0, 4.0, 9.0]).unwrap();
        assert_eq!(ratio, 2.0);
        assert_eq!(beyond(&[1.0, 2.0], true, ratio, 2), [4.0, 8.0]);
        assert_eq!(beyond(&[1.0, 2.0], false, ratio, 2), [0.25, 0.5]);
        assert_eq!(around(&[8.0], ratio, 3), [4.0, 8.0, 16.0]);
        assert_eq!(around(&[4.0, 8.0], ratio, 5), [2.0, 4.0, 8.0, 16.0, 32.0]);
        assert_eq!(median_ratio(&[3.0]), None);
        assert!(around(&[], ratio, 3).is_empty());
    }
}
