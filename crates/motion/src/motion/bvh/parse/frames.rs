//! The part after MOTION.

use super::words::finite;
use crate::motion::bvh::error::BvhError;

/// Seconds from frame to frame, and the frames' numbers, from the line with index `first` on.
pub fn parse(
    lines: &[&str],
    first: usize,
    n_channels: usize,
) -> Result<(f64, Vec<Vec<f64>>), BvhError> {
    let numbered = lines.iter().enumerate().skip(first).map(|(index, &line)| (index + 1, line));
    let mut left = numbered.filter(|(_, line)| !line.trim().is_empty());
    let mut next = |expected| left.next().ok_or_else(|| BvhError::end(lines.len(), expected));
    let (line, text) = next(FRAMES)?;
    let said: usize = value(text, "Frames", FRAMES, line, |text| text.parse().ok())?;
    let (time_line, text) = next(TIME)?;
    let positive = |text: &str| finite(text).filter(|&seconds| seconds > 0.0);
    let frame_time_s = value(text, "Frame Time", TIME, time_line, positive)?;
    let frames: Vec<Vec<f64>> =
        left.map(|(line, text)| frame(text, line, n_channels)).collect::<Result<_, _>>()?;
    if frames.len() != said {
        return Err(BvhError::FrameCount { line, said, found: frames.len() });
    }
    Ok((frame_time_s, frames))
}

const FRAMES: &str = "\"Frames:\" and a count";
const TIME: &str = "\"Frame Time:\" and seconds above zero";

/// The value after a key and a colon.
fn value<T>(
    text: &str,
    key: &str,
    expected: &str,
    line: usize,
    parse: impl Fn(&str) -> Option<T>,
) -> Result<T, BvhError> {
    let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    text.split_once(':')
        .filter(|(name, _)| words(name).eq_ignore_ascii_case(key))
        .and_then(|(_, value)| parse(value.trim()))
        .ok_or_else(|| BvhError::word(line, expected, text.trim()))
}

fn frame(text: &str, line: usize, n_channels: usize) -> Result<Vec<f64>, BvhError> {
    let number = |word: &str| finite(word).ok_or_else(|| BvhError::word(line, "a number", word));
    let frame: Vec<f64> = text.split_whitespace().map(number).collect::<Result<_, _>>()?;
    if frame.len() != n_channels {
        return Err(BvhError::FrameLength { line, expected: n_channels, found: frame.len() });
    }
    Ok(frame)
}
