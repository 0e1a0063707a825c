//! [`MotionSource`]: the interface of every source of motion to tokenizers and trainers; the mean and deviation of its
//! features, and its digest.

use std::fmt::Display;
use std::io;
use std::ops::Range;
use std::path::Path;

use blake3::{Hash, Hasher};
use serde::{Deserialize, Serialize};

use super::npy::{NpyProblem, parse_npy};
use crate::failure::FailureKind;
use crate::files::{LARGE, read_regular};
use crate::motion::N_FEATURES;

/// Clips come in multiples of so many frames, as the public loaders of HumanML3D crop them.
pub const UNIT_FRAMES: usize = 4;

/// A split of a data set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Split {
    Train,
    Val,
    Test,
}

impl Split {
    /// Every split, in the order in which files list them.
    pub const ALL: [Split; 3] = [Split::Train, Split::Val, Split::Test];

    /// The name used in files: `train`, `val`, `test`.
    pub fn name(self) -> &'static str {
        ["train", "val", "test"][self as usize]
    }
}

/// Mean and standard deviation of each feature over the training split, for z-normalisation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FeatureStats {
    /// `[N_FEATURES]`.
    pub mean: Vec<f32>,
    /// `[N_FEATURES]`, strictly positive.
    pub std: Vec<f32>,
}

/// The facts shared by all clips of a source; see [`MotionSource`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Metadata {
    pub stats: FeatureStats,
    pub fps: f32,
    pub digest: String,
    /// Whether half of a tokenizer's windows are of [long clips](MotionSource::n_long).
    pub half_long: bool,
    pub warnings: Vec<String>,
    pub remarks: Vec<String>,
}

/// The errors of a data set.
#[derive(Debug, thiserror::Error)]
pub enum DataError {
    /// A file could not be read.
    #[error("cannot read {path}: {source}; {advice}")]
    Read { path: String, source: io::Error, advice: &'static str },
    /// A file was read, but is invalid.
    #[error("{path}: {problem}")]
    Invalid { path: String, problem: String },
    /// Nothing is left to train or test on.
    #[error("the {split} split of {path} holds no usable clip")]
    EmptySplit { path: String, split: &'static str },
    /// Files or lines are broken, and the options refuse them; every one is listed.
    #[error(
        "{path}: {} broken files or lines; mend them, or skip them with a warning each:\n  {}",
        problems.len(),
        problems.join("\n  ")
    )]
    Broken { path: String, problems: Vec<String> },
}

impl DataError {
    /// The item at `path` is invalid.
    pub(super) fn invalid(path: impl Display, problem: impl Into<String>) -> Self {
        Self::Invalid { path: path.to_string(), problem: problem.into() }
    }

    /// The file at `path` could not be read.
    pub(super) fn read(path: &Path, advice: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Read { path: path.display().to_string(), source, advice }
    }

    /// The failure of a job that ends with it.
    pub fn failure_kind(&self) -> FailureKind {
        match self {
            Self::Read { source, .. } => FailureKind::of_io(source).unwrap_or(FailureKind::BadData),
            _ => FailureKind::BadData,
        }
    }
}

/// A set of clips, each with features and captions, addressed by split and index.
///
/// Clips are items after cropping, sub-captions and mirroring: index `i` always means the same frames and captions, in
/// any order of access.
pub trait MotionSource: Sync {
    /// Number of clips in `split`.
    fn n_clips(&self, split: Split) -> usize;

    /// Clips of the training split that are too long for an item. Only tokenizers train on them; their indices follow
    /// the others'.
    fn n_long(&self) -> usize {
        0
    }

    /// A name for messages: the file's stem, with a letter before it for a sub-caption's clip.
    fn clip_id(&self, split: Split, index: usize) -> String {
        format!("{}-{index}", split.name())
    }

    /// The clips of some splits, split by split.
    fn clips(&self, splits: &[Split]) -> Vec<(Split, usize)> {
        let of = |&split: &Split| (0..self.n_clips(split)).map(move |index| (split, index));
        splits.iter().flat_map(of).collect()
    }

    /// Clips recorded at one time, or by one performer: clips of a group are similar. By default each clip is its own
    /// group.
    fn group(&self, split: Split, index: usize) -> String {
        self.clip_id(split, index)
    }

    /// Frames of the clip; known without producing its features. A multiple of 4.
    fn n_frames(&self, split: Split, index: usize) -> usize;

    /// The clip's captions, lower-case, at least one.
    fn captions(&self, split: Split, index: usize) -> Vec<String>;

    /// The words of each caption with their parts of speech, as `walk/VERB`; empty if the data have none.
    fn tokens(&self, split: Split, index: usize) -> Vec<String> {
        vec![String::new(); self.captions(split, index).len()]
    }

    /// Raw (not normalised) features, row-major `[n_frames, N_FEATURES]`.
    fn features(&self, split: Split, index: usize) -> Result<Vec<f32>, DataError>;

    /// The facts shared by all clips.
    fn metadata(&self) -> &Metadata;

    /// Mean and deviation over the training split.
    fn stats(&self) -> &FeatureStats {
        &self.metadata().stats
    }

    /// Frames per second.
    fn fps(&self) -> f32 {
        self.metadata().fps
    }

    /// Blake3 hex digest of everything that the clips follow from; no path and no time in it.
    fn digest(&self) -> &str {
        &self.metadata().digest
    }

    /// Sentences about files that were skipped, one each, naming the file and the reason.
    fn warnings(&self) -> &[String] {
        &self.metadata().warnings
    }

    /// Sentences about clips that are used and may be wrong.
    fn remarks(&self) -> &[String] {
        &self.metadata().remarks
    }

    /// The data sets that it is put together from; none where it is one.
    fn members(&self) -> &[Member] {
        &[]
    }
}

/// A data set of several.
pub struct Member {
    /// Its name in messages.
    pub name: String,
    /// Its licence, if given.
    pub licence: Option<String>,
    pub source: Box<dyn MotionSource>,
}

// Mean and deviation of features, from `Mean.npy` and `Std.npy` or over the training clips.

/// Columns that share one deviation, the mean of theirs: root turn, root step, root height,
/// positions, rotations, velocities, contacts.
pub const FEATURE_GROUPS: [Range<usize>; 7] =
    [0..1, 1..3, 3..4, 4..67, 67..193, 193..259, 259..263];

/// Deviations from the mean, on average over all features, beyond which features are not of the data that mean
/// and deviation are of; those have about 0.7.
pub const FAR: f64 = 5.0;

impl FeatureStats {
    /// Mean distance of features, `[T, 263]` row-major, from their mean, in standard deviations.
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
            let sums = self.sums.iter_mut().zip(&mut self.squares);
            for ((&value, origin), (sum, square)) in row.iter().zip(&self.origin).zip(sums) {
                let difference = f64::from(value) - origin;
                *sum += difference;
                *square += difference * difference;
            }
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
        let mut std = vec![0.0; N_FEATURES];
        for group in FEATURE_GROUPS {
            let columns = deviations.get(group.clone())?;
            std[group].fill((columns.iter().sum::<f64>() / columns.len() as f64) as f32);
        }
        std.iter().all(|&value| value > 0.0).then_some(FeatureStats { mean, std })
    }
}

/// `Mean.npy` and `Std.npy` in `root`, or `None` if neither is there.
///
/// # Errors
/// [`DataError`] if only one is there, or one is not 263 finite numbers, positive in `Std.npy`.
pub fn read_stats(root: &Path) -> Result<Option<(FeatureStats, [UsedFile; 2])>, DataError> {
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

// The digest of a data set: the content of its clips, independent of the path.

/// A file that took part in making the clips.
#[derive(Clone, Debug)]
pub struct UsedFile {
    /// Name within the data set, with `/` between folders.
    pub name: String,
    /// Blake3 of its content.
    pub hash: Hash,
}

impl UsedFile {
    pub fn new(name: &str, content: &[u8]) -> UsedFile {
        UsedFile { name: name.to_owned(), hash: blake3::hash(content) }
    }
}

/// Hex digest of `rules`, which says how clips follow from files, and of `files` in any order.
pub fn digest(rules: &str, files: &[UsedFile]) -> String {
    let mut sorted: Vec<&UsedFile> = files.iter().collect();
    sorted.sort_by(|a, b| a.name.cmp(&b.name));
    let mut hasher = Hasher::new();
    hasher.update(blake3::hash(rules.as_bytes()).as_bytes());
    for file in sorted {
        // A hash of the name has a fixed length, so that no two lists of files read the same.
        hasher.update(blake3::hash(file.name.as_bytes()).as_bytes());
        hasher.update(file.hash.as_bytes());
    }
    hasher.finalize().to_hex().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::npy::npy_bytes;

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
            let bytes = npy_bytes(&[values.len()], values);
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

    #[test]
    fn order_plays_no_part_and_names_contents_and_rules_do() {
        let [a, b] = [UsedFile::new("a", b"1"), UsedFile::new("b", b"2")];
        let base = digest("rules", &[a.clone(), b.clone()]);
        assert_eq!(digest("rules", &[b.clone(), a.clone()]), base);
        let others = [
            digest("other rules", &[a.clone(), b.clone()]),
            digest("rules", std::slice::from_ref(&a)),
            digest("rules", &[a, UsedFile::new("c", b"2")]),
            digest("rules", &[UsedFile::new("a", b"3"), b]),
        ];
        assert!(others.iter().all(|other| *other != base));
    }
}
