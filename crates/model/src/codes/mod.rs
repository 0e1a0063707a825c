//! The codes of a data set, the interface between a tokenizer and a generator.
//!
//! # Example
//!
//! ```
//! use isoflop_model::codes::CodeHistogram;
//!
//! let histogram = CodeHistogram::new(4, &[0, 1, 1, 2]);
//! assert_eq!(histogram.utilisation(), 0.75); // three of four codes are met
//! ```

mod compared;
mod metrics;
mod store;

use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::files::{FileError, atomic, read_if_there};

pub use crate::spec::{Grid, Length, Scale};
pub use compared::{MOVEMENT, percent, remarks, table, two_decimals};
pub use metrics::{Baseline, CodeMap, Continuity, ScaleCodes, ScaleUse, TokenizerMetrics};
pub use store::{SplitTokens, TokenStore, write_store};

// Code frequencies and their statistics.

/// Counts of codes over a whole split.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CodeHistogram {
    counts: Vec<u64>,
}

impl CodeHistogram {
    /// Counts of ids below `n_vocab`.
    pub fn new<'a>(n_vocab: usize, ids: impl IntoIterator<Item = &'a u32>) -> Self {
        let mut histogram = Self { counts: vec![0; n_vocab] };
        histogram.add(ids);
        histogram
    }

    /// Counts more ids.
    pub fn add<'a>(&mut self, ids: impl IntoIterator<Item = &'a u32>) {
        ids.into_iter().for_each(|&id| self.counts[id as usize] += 1);
    }

    /// Combines several codebooks into one.
    pub fn together(parts: &[Self]) -> Self {
        Self { counts: parts.iter().flat_map(|part| part.counts.iter().copied()).collect() }
    }

    /// The count of each code, `[n_vocab]`.
    pub fn counts(&self) -> &[u64] {
        &self.counts
    }

    /// Share of the codes that were met at all.
    pub fn utilisation(&self) -> f64 {
        let met = self.counts.iter().filter(|&&count| count > 0).count();
        met as f64 / self.counts.len() as f64
    }

    /// exp(−Σ p ln p): how many codes used equally often would be as uncertain.
    ///
    /// The released code adds 10⁻⁷ inside the logarithm, which lowers the value by less than 1 %
    /// up to 64 thousand codes.
    pub fn exponential_entropy(&self) -> f64 {
        let total: u64 = self.counts.iter().sum();
        let share = |&count: &u64| count as f64 / total as f64;
        let met = self.counts.iter().filter(|&&count| count > 0);
        met.map(share).map(|p| -p * p.ln()).sum::<f64>().exp()
    }
}

// The codes of one clip in a file.

/// Frames beyond which a number is taken for a slip of the pen: eighty minutes.
const MOST_FRAMES: usize = 100_000;

/// The codes of one clip, with their source.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClipCodes {
    /// The tokenizer that can decode them.
    pub tokenizer_id: String,
    /// The name of the file that the motion came from, without its folder.
    pub motion: String,
    /// The caption given to a tokenizer with language.
    pub caption: Option<String>,
    /// Frames per second.
    pub fps: f64,
    /// Frames covered by the codes: whole latents.
    pub frames: usize,
    pub scales: Vec<ClipScale>,
    /// Scale after scale.
    pub codes: Vec<u32>,
}

/// A scale of one clip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClipScale {
    /// Codes of the codebook.
    pub n_vocab: usize,
    /// Codes of the clip.
    pub n_codes: usize,
}

impl ClipScale {
    /// The scales of a clip of so many frames.
    pub fn of(grid: &Grid, frames: usize) -> Vec<Self> {
        let scales = grid.scales.iter().zip(grid.lengths(frames));
        scales.map(|(scale, n_codes)| Self { n_vocab: scale.n_vocab, n_codes }).collect()
    }
}

impl ClipCodes {
    /// Writes it as JSON, whole, by rename.
    ///
    /// # Errors
    /// [`FileError::Write`].
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        atomic::write_json(path, self)
    }

    /// Reads a file of [`ClipCodes::write`].
    ///
    /// # Errors
    /// The file is missing, has another format, or contradicts itself.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let advice = "`isoflop tokenize` writes such files";
        let read: Option<Self> = read_if_there(path).map_err(|error| error.with_advice(advice))?;
        let read = read.ok_or_else(|| FileError::read(path)(io::ErrorKind::NotFound.into()))?;
        match read.problem() {
            None => Ok(read),
            Some(problem) => Err(FileError::damaged(path, problem).with_advice(advice)),
        }
    }

    /// The contradiction in a clip, if any.
    fn problem(&self) -> Option<String> {
        let wanted: usize = self.scales.iter().map(|scale| scale.n_codes).sum();
        let found = self.codes.len();
        if found != wanted {
            return Some(format!("its scales have {wanted} codes, and it holds {found}"));
        }
        if self.frames == 0 || self.frames > MOST_FRAMES {
            return Some(format!("{} frames are no clip", self.frames));
        }
        let is_rate = self.fps.is_finite() && self.fps > 0.0;
        (!is_rate).then(|| format!("{} frames a second are no rate", self.fps))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn utilisation_counts_codes_that_were_met() {
        let histogram = CodeHistogram::new(8, &[3, 3, 0, 7, 3]);
        assert_eq!(histogram.counts(), [1, 0, 0, 3, 0, 0, 0, 1]);
        assert_eq!(histogram.utilisation(), 3.0 / 8.0);
    }

    #[test]
    fn codes_of_several_codebooks_are_apart() {
        let parts = [CodeHistogram::new(2, &[0, 1]), CodeHistogram::new(3, &[0, 1])];
        let together = CodeHistogram::together(&parts);
        assert_eq!(together.counts(), [1, 1, 1, 1, 0]);
        assert!((together.exponential_entropy() - 4.0).abs() < 1e-12);
    }

    #[test]
    fn equally_frequent_codes_count_as_many_as_they_are() {
        let entropy = CodeHistogram::new(9, &[1, 2, 5, 1, 2, 5]).exponential_entropy();
        assert!((entropy - 3.0).abs() < 1e-12, "{entropy}");
        assert_eq!(CodeHistogram::new(9, &[4, 4]).exponential_entropy(), 1.0);
    }

    fn clip() -> ClipCodes {
        let scale = |n_vocab, length| Scale { n_vocab, length };
        let scales = vec![scale(8, Length::Codes(2)), scale(16, Length::FramesPerCode(4))];
        let grid = Grid { scales, end_token: false };
        ClipCodes {
            tokenizer_id: "a1".into(),
            motion: "walk.npy".into(),
            caption: None,
            fps: 20.0,
            frames: 12,
            scales: ClipScale::of(&grid, 12),
            codes: vec![7, 0, 1, 2, 15],
        }
    }

    #[test]
    fn a_clip_reads_as_it_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("walk.json");
        clip().write(&path).unwrap();
        let read = ClipCodes::read(&path).unwrap();
        assert_eq!(read, clip());
        assert_eq!(read.scales.iter().map(|s| s.n_codes).collect::<Vec<_>>(), [2, 3]);
    }

    #[test]
    fn a_file_that_contradicts_itself_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("walk.json");
        let refused = |clip: ClipCodes, words: &str| {
            clip.write(&path).unwrap();
            let error = ClipCodes::read(&path).unwrap_err().to_string();
            assert!(error.contains("walk.json") && error.contains(words), "{error}");
        };
        refused(ClipCodes { codes: vec![1], ..clip() }, "its scales have 5 codes, and it holds 1");
        refused(ClipCodes { frames: 0, ..clip() }, "0 frames are no clip");
        refused(ClipCodes { frames: usize::MAX, ..clip() }, "frames are no clip");
        refused(ClipCodes { fps: 0.0, ..clip() }, "0 frames a second");
        std::fs::write(&path, "{\"codes\": [-1]}").unwrap();
        let error = ClipCodes::read(&path).unwrap_err().to_string();
        assert!(error.contains("`isoflop tokenize` writes such files"), "{error}");
        let error = ClipCodes::read(&folder.path().join("no.json")).unwrap_err().to_string();
        assert!(error.contains("cannot read"), "{error}");
    }
}
