//! [`MotionSource`]: what every source of motion offers to tokenizers and trainers.

use std::fmt::Display;
use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::failure::FailureKind;

/// Clips come in multiples of so many frames, as the public loaders of HumanML3D crop them.
pub const UNIT_FRAMES: usize = 4;

/// Which part of a data set.
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

/// What holds for all clips of a source; see [`MotionSource`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Metadata {
    pub stats: FeatureStats,
    pub fps: f32,
    pub digest: String,
    pub warnings: Vec<String>,
}

/// What can be wrong with a data set.
#[derive(Debug, thiserror::Error)]
pub enum DataError {
    /// A file could not be read.
    #[error("cannot read {path}: {source}; {advice}")]
    Read { path: String, source: io::Error, advice: &'static str },
    /// A file was read and is not what it should be.
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
    /// What stands at `path` is not what it should be.
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
/// Clips are items after every rule of cropping, sub-captions and mirroring has been applied:
/// index `i` always means the same frames and the same captions, whoever asks and in any order.
pub trait MotionSource: Sync {
    /// Number of clips in `split`.
    fn n_clips(&self, split: Split) -> usize;

    /// A name for messages: the file's stem, with a letter before it for a sub-caption's clip.
    fn clip_id(&self, split: Split, index: usize) -> String {
        format!("{}-{index}", split.name())
    }

    /// The clips of some splits, split by split.
    fn clips(&self, splits: &[Split]) -> Vec<(Split, usize)> {
        let of = |&split: &Split| (0..self.n_clips(split)).map(move |index| (split, index));
        splits.iter().flat_map(of).collect()
    }

    /// What was recorded at one time, or by one performer: clips of a group are alike, those of several are
    /// not. Each clip is its own unless the source knows more.
    fn group(&self, split: Split, index: usize) -> String {
        self.clip_id(split, index)
    }

    /// Frames of the clip; known without producing its features. A multiple of 4.
    fn n_frames(&self, split: Split, index: usize) -> usize;

    /// The clip's captions, lower-case, at least one.
    fn captions(&self, split: Split, index: usize) -> Vec<String>;

    /// Raw (not normalised) features, row-major `[n_frames, N_FEATURES]`.
    fn features(&self, split: Split, index: usize) -> Result<Vec<f32>, DataError>;

    /// What holds for all clips.
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

    /// The data sets that it is put together from; none where it is one.
    fn members(&self) -> &[Member] {
        &[]
    }
}

/// A data set of several.
pub struct Member {
    /// Its name in messages.
    pub name: String,
    /// The terms of its use, where they were given.
    pub licence: Option<String>,
    pub source: Box<dyn MotionSource>,
}
