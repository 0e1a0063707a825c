//! Mean and deviation of features, from `Mean.npy` and `Std.npy` or over the training clips.

use std::ops::Range;
use std::path::Path;

use super::digest::UsedFile;
use super::npy::{NpyProblem, parse_npy};
use super::source::{DataError, FeatureStats};
use crate::files::{LARGE, read_regular};
use crate::motion::N_FEATURES;

/// Columns that share one deviation, the mean of theirs: root turn, root step, root height,
/// positions, rotations, velocities, contacts.
pub const FEATURE_GROUPS: [Range<usize>; 7] =
    [0..1, 1..3, 3..4, 4..67, 67..193, 193..259, 259..263];

/// Deviations from the mean, on the mean over all features, beyond which features are not of the data that mean
/// and deviation are of; those have about 0.7.
pub const FAR: f64 = 5.0;

impl FeatureStats {
    /// How many deviations features, `[T, 263]` row-major, are from their mean, on the mean.
    pub fn deviations(&self, features: &[f32]) -> f64 {
        let columns = self.mean.iter().zip(&self.std).cycle();
        let each = features.iter().zip(columns);
        let sum: f64 = each.map(|(x, (mean, std))| f64::from((x - mean) / std).abs()).sum();
        sum / features.len() as f64
    }
}

/// Sums from which mean and deviation follow.
#[derive(Clone, Debug, Default)]
pub struct StatsAccumulator {
    n_frames: u64,
    /// The first row: sums are of differences from it, so that no precision is lost to a large
    /// mean and a constant column has deviation zero exactly.
    origin: Vec<f64>,
    sums: Vec<f64>,
    squares: Vec<f64>,
}

impl StatsAccumulator {
    /// Takes in the rows of `features`, `[T, 263]` row-major.
    pub fn add(&mut self, features: &[f32]) {
        for row in features.chunks_exact(N_FEATURES) {
            if self.n_frames == 0 {
                self.origin = row.iter().map(|&value| f64::from(value)).collect();
                (self.sums, self.squares) = (vec![0.0; N_FEATURES], vec![0.0; N_FEATURES]);
            }
            self.n_frames += 1;
            self.add_row(row);
        }
    }

    fn add_row(&mut self, row: &[f32]) {
        let sums = self.sums.iter_mut().zip(&mut self.squares);
        for ((&value, origin), (sum, square)) in row.iter().zip(&self.origin).zip(sums) {
            let difference = f64::from(value) - origin;
            *sum += difference;
            *square += difference * difference;
        }
    }

    /// Mean of each column, and its deviation (of the population) averaged over the column's
    /// [group](FEATURE_GROUPS), as HumanML3D's `cal_mean_variance` does it.
    ///
    /// `None` if some group is constant or there is no row: nothing can be divided by its
    /// deviation.
    pub fn finish(&self) -> Option<FeatureStats> {
        let n = self.n_frames as f64;
        let mean = self.origin.iter().zip(&self.sums).map(|(o, s)| (o + s / n) as f32).collect();
        let deviations: Vec<f64> = (self.sums.iter().zip(&self.squares))
            .map(|(sum, square)| (square / n - (sum / n).powi(2)).max(0.0).sqrt())
            .collect();
        let std = grouped(&deviations)?;
        Some(FeatureStats { mean, std })
    }
}

/// Each group's mean in place of its values; `None` if one is zero.
fn grouped(deviations: &[f64]) -> Option<Vec<f32>> {
    let mut std = vec![0.0; N_FEATURES];
    for group in FEATURE_GROUPS {
        let columns = deviations.get(group.clone())?;
        std[group].fill((columns.iter().sum::<f64>() / columns.len() as f64) as f32);
    }
    std.iter().all(|&value| value > 0.0).then_some(std)
}

/// `Mean.npy` and `Std.npy` in `root`, or `None` if neither is there.
///
/// # Errors
/// [`DataError`] if only one is there, or one is not 263 finite numbers, positive in `Std.npy`.
pub(super) fn read_stats(root: &Path) -> Result<Option<(FeatureStats, [UsedFile; 2])>, DataError> {
    let names = ["Mean.npy", "Std.npy"];
    if names.iter().all(|name| !root.join(name).exists()) {
        return Ok(None);
    }
    let [(mean, mean_file), (std, std_file)] =
        [read_row(root, names[0])?, read_row(root, names[1])?];
    if let Some(column) = std.iter().position(|&value| value <= 0.0) {
        let problem = format!("deviation {} of column {column} is not positive", std[column]);
        return Err(DataError::invalid(root.join(names[1]).display(), problem));
    }
    Ok(Some((FeatureStats { mean, std }, [mean_file, std_file])))
}

fn read_row(root: &Path, name: &str) -> Result<(Vec<f32>, UsedFile), DataError> {
    let path = root.join(name);
    let advice = "Mean.npy and Std.npy are given together or not at all";
    let bytes = read_regular(&path, LARGE).map_err(DataError::read(&path, advice))?;
    let row = parse_npy(&bytes).and_then(|array| match array.shape[..] {
        [N_FEATURES] => Ok(array.values),
        _ => Err(NpyProblem::Shape { found: array.shape, expected: "[263]" }),
    });
    let row = row.map_err(|problem| DataError::invalid(path.display(), problem.to_string()))?;
    Ok((row, UsedFile::new(name, &bytes)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::fixtures::npy_bytes;

    /// Four rows around 1000 whose column `c` deviates by `c + 1`.
    fn rows() -> Vec<f32> {
        let value = |t: usize, c: usize| {
            1000.0 + if t.is_multiple_of(2) { 1.0 } else { -1.0 } * (c + 1) as f32
        };
        (0..4).flat_map(|t| (0..N_FEATURES).map(move |c| value(t, c))).collect()
    }

    #[test]
    fn deviations_are_averaged_within_groups() {
        let mut accumulator = StatsAccumulator::default();
        accumulator.add(&rows()[..N_FEATURES]);
        accumulator.add(&rows()[N_FEATURES..]);
        let stats = accumulator.finish().expect("no group is constant");
        assert_eq!(stats.mean, vec![1000.0; N_FEATURES]);
        // Deviations 1 to 263: the mean over columns from..to is (from + 1 + to) / 2.
        for (column, expected) in [(0, 1.0), (1, 2.5), (2, 2.5), (3, 4.0), (4, 36.0), (262, 261.5)]
        {
            assert!((stats.std[column] - expected).abs() < 1e-4, "column {column}");
        }
    }

    #[test]
    fn a_constant_group_has_no_usable_deviation() {
        let mut accumulator = StatsAccumulator::default();
        let mut rows = rows();
        rows.chunks_exact_mut(N_FEATURES).for_each(|row| row[259..].fill(0.1));
        accumulator.add(&rows);
        assert_eq!(accumulator.finish(), None);
        assert_eq!(StatsAccumulator::default().finish(), None);
    }

    #[test]
    fn stats_files_come_in_pairs_of_positive_rows() {
        let root = tempfile::tempdir().expect("a temporary folder");
        let write = |name: &str, values: &[f32]| {
            let bytes = npy_bytes(&[values.len() as u64], values);
            std::fs::write(root.path().join(name), bytes).expect("a writable folder");
        };
        let problem = || read_stats(root.path()).expect_err("something is wrong").to_string();
        assert!(read_stats(root.path()).expect("absent files are no error").is_none());
        write("Mean.npy", &[0.5; N_FEATURES]);
        assert!(problem().contains("Std.npy") && problem().contains("together"), "{}", problem());
        write("Std.npy", &[0.0; N_FEATURES]);
        assert!(problem().contains("column 0 is not positive"), "{}", problem());
        write("Std.npy", &[1.0; 251]);
        assert!(problem().contains("[251] where [263]"), "{}", problem());
        write("Std.npy", &[2.0; N_FEATURES]);
        let (stats, _) = read_stats(root.path()).expect("both are good").expect("both are there");
        assert_eq!((stats.mean[262], stats.std[0]), (0.5, 2.0));
    }
}
