//! [`ClipCodes`]: the codes of one clip in a file of their own.

use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::Grid;
use crate::files::{FileError, atomic, read_if_there};

/// Frames beyond which a number is taken for a slip of the pen: eighty minutes.
const MOST_FRAMES: usize = 100_000;

/// The codes of one clip, and what they are codes of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClipCodes {
    /// The tokenizer, which alone can tell what they mean.
    pub tokenizer_id: String,
    /// The name of the file that the motion came from, without its folder.
    pub motion: String,
    /// What a tokenizer with language was shown.
    pub caption: Option<String>,
    /// Frames a second.
    pub fps: f64,
    /// Frames that the codes stand for: whole latents.
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

    /// Reads what [`ClipCodes::write`] wrote.
    ///
    /// # Errors
    /// The file is missing, is none of these, or contradicts itself.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let advice = "`isoflop tokenize` writes such files";
        let read: Option<Self> = read_if_there(path).map_err(|error| error.with_advice(advice))?;
        let missing = || FileError::read(path)(io::ErrorKind::NotFound.into());
        let read = read.ok_or_else(missing)?;
        match read.problem() {
            None => Ok(read),
            Some(problem) => Err(FileError::damaged(path, problem).with_advice(advice)),
        }
    }

    /// What cannot be true of a clip.
    fn problem(&self) -> Option<String> {
        let (found, wanted) =
            (self.codes.len(), self.scales.iter().map(|scale| scale.n_codes).sum::<usize>());
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
    use crate::codes::{Length, Scale};

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
