//! [`BvhError`]: where a text stops being a BVH file.

use thiserror::Error;

/// Where and why a text is no BVH file; reads on after the file's name and a colon.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum BvhError {
    /// Another word stands where the format has its own.
    #[error("line {line}: {expected} is expected, here is {found:?}")]
    Word { line: usize, expected: String, found: String },
    /// The text ends too early.
    #[error("the file ends at line {line}, where {expected} is expected: it is cut short")]
    End { line: usize, expected: String },
    /// A frame has another count of numbers than the hierarchy has channels.
    #[error("line {line}: a frame of this hierarchy has {expected} numbers, here are {found}")]
    FrameLength { line: usize, expected: usize, found: usize },
    /// There are more or fewer frames than the file says.
    #[error(
        "line {line} announces {said} frames, {found} follow; correct the number or the frames"
    )]
    FrameCount { line: usize, said: usize, found: usize },
}

impl BvhError {
    /// Another word, of which a long one is shown in part.
    pub(super) fn word(line: usize, expected: &str, found: &str) -> BvhError {
        let mut found = found.to_owned();
        if let Some((cut, _)) = found.char_indices().nth(60) {
            found.truncate(cut);
            found.push('…');
        }
        BvhError::Word { line, expected: expected.to_owned(), found }
    }

    pub(super) fn end(line: usize, expected: &str) -> BvhError {
        BvhError::End { line, expected: expected.to_owned() }
    }
}
