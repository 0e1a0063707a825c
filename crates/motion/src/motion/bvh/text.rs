//! [`Bvh`] as the text of a file, written and read.

use std::fmt::{self, Display, Formatter};
use std::vec::IntoIter;

use thiserror::Error;

use super::hierarchy::{Bvh, BvhJoint, Channel};
use crate::motion::geometry::Point;

/// Decimals of offsets and channels: a micrometre, or a micrometre at a metre from the joint.
const DECIMALS: usize = 4;

impl Display for Bvh {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(f, "HIERARCHY")?;
        let mut roots = (0..self.joints.len()).filter(|&j| self.joints[j].parent.is_none());
        roots.try_for_each(|root| self.joint(f, root, 0))?;
        writeln!(f, "MOTION\nFrames: {}", self.frames.len())?;
        writeln!(f, "Frame Time: {:.8}", self.frame_time_s)?;
        self.frames.iter().try_for_each(|frame| writeln!(f, "{}", numbers(frame)))
    }
}

impl Bvh {
    /// A joint with all below it.
    fn joint(&self, f: &mut Formatter<'_>, index: usize, depth: usize) -> fmt::Result {
        let (joint, indent) = (&self.joints[index], "  ".repeat(depth));
        let word = if joint.parent.is_none() { "ROOT" } else { "JOINT" };
        writeln!(f, "{indent}{word} {}\n{indent}{{", joint.name)?;
        writeln!(f, "{indent}  OFFSET {}", numbers(&joint.offset))?;
        writeln!(f, "{indent}  CHANNELS {}", channels(joint))?;
        for end in &joint.end_sites {
            let offset = numbers(end);
            writeln!(f, "{indent}  End Site\n{indent}  {{\n{indent}    OFFSET {offset}")?;
            writeln!(f, "{indent}  }}")?;
        }
        let mut children = (0..self.joints.len()).filter(|&j| self.joints[j].parent == Some(index));
        children.try_for_each(|child| self.joint(f, child, depth + 1))?;
        writeln!(f, "{indent}}}")
    }
}

fn channels(joint: &BvhJoint) -> String {
    let names = Channel::NAMES;
    let named = |own: &Channel| names.into_iter().find(|(channel, _)| channel == own);
    let words = joint.channels.iter().filter_map(named).map(|(_, name)| format!(" {name}"));
    format!("{}{}", joint.channels.len(), words.collect::<String>())
}

fn numbers(values: &[f64]) -> String {
    let texts: Vec<String> =
        values.iter().map(|&value| format!("{:.DECIMALS$}", rounded(value))).collect();
    texts.join(" ")
}

/// The number that the file holds for `value`; never a zero with a sign.
pub fn rounded(value: f64) -> f64 {
    let scale = 10f64.powi(DECIMALS as i32);
    let rounded = (value * scale).round() / scale + 0.0;
    // A number near the end of the range has no decimals.
    if rounded.is_finite() { rounded } else { value }
}

// Reading.

/// Place and reason of an invalid BVH text; phrased to follow the file's name and a colon.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum BvhError {
    /// An unexpected word.
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
    fn word(line: usize, expected: &str, found: &str) -> BvhError {
        let mut found = found.to_owned();
        if let Some((cut, _)) = found.char_indices().nth(60) {
            found.truncate(cut);
            found.push('…');
        }
        BvhError::Word { line, expected: expected.to_owned(), found }
    }

    fn end(line: usize, expected: &str) -> BvhError {
        BvhError::End { line, expected: expected.to_owned() }
    }
}

impl Bvh {
    /// Parses `text`.
    ///
    /// Any hierarchy is read: several roots, joints with any channels in any order or with none,
    /// several End Sites, names of several words, keywords in any case. A frame is a line.
    ///
    /// # Errors
    /// [`BvhError`] names the line and what is expected there.
    pub fn parse(text: &str) -> Result<Bvh, BvhError> {
        let text = text.trim_start_matches('\u{feff}');
        let lines: Vec<&str> = text.lines().collect();
        let is_motion = |line: &&str| line.trim().eq_ignore_ascii_case("MOTION");
        let Some(motion) = lines.iter().position(is_motion) else {
            return Err(BvhError::end(lines.len(), "the line MOTION"));
        };
        let joints = hierarchy(&lines[..motion])?;
        let n_channels = joints.iter().map(|joint| joint.channels.len()).sum();
        let (frame_time_s, frames) = frames(&lines, motion + 1, n_channels)?;
        Ok(Bvh { joints, frame_time_s, frames })
    }
}

/// The joints of a hierarchy, in the order of the text.
fn hierarchy<'a>(lines: &[&'a str]) -> Result<Vec<BvhJoint>, BvhError> {
    let on = |(index, line): (usize, &&'a str)| {
        line.split_whitespace().map(move |text| Word { line: index + 1, text })
    };
    let words: Vec<Word> = lines.iter().enumerate().flat_map(on).collect();
    let (words, n_lines) = (words.into_iter(), lines.len());
    let mut reader = Reader { words, n_lines, joints: Vec::new(), open: Vec::new() };
    reader.keyword("HIERARCHY")?;
    while !reader.words.as_slice().is_empty() {
        reader.statement()?;
    }
    let missing = match (reader.open.is_empty(), reader.joints.is_empty()) {
        (false, _) => "}",
        (true, true) => "ROOT",
        (true, false) => return Ok(reader.joints),
    };
    Err(BvhError::end(n_lines, missing))
}

/// A word and its line, counted from 1.
#[derive(Clone, Copy)]
struct Word<'a> {
    line: usize,
    text: &'a str,
}

impl Word<'_> {
    /// The error that something else was expected.
    fn instead_of(self, expected: &str) -> BvhError {
        BvhError::word(self.line, expected, self.text)
    }
}

/// The purpose of an open brace.
#[derive(Clone, Copy)]
enum Open {
    Joint(usize),
    EndSite(usize),
}

struct Reader<'a> {
    /// The words that are left.
    words: IntoIter<Word<'a>>,
    n_lines: usize,
    joints: Vec<BvhJoint>,
    /// Open braces, the outermost first.
    open: Vec<Open>,
}

impl<'a> Reader<'a> {
    fn statement(&mut self) -> Result<(), BvhError> {
        let word = self.take("a statement")?;
        match (self.open.last().copied(), &*word.text.to_ascii_uppercase()) {
            (None, "ROOT") => self.begin_joint(word, None)?,
            (None, _) => return Err(word.instead_of("ROOT or MOTION")),
            (Some(_), "}") => drop(self.open.pop()),
            (Some(Open::Joint(at)), "OFFSET") => self.joints[at].offset = self.offset()?,
            (Some(Open::Joint(at)), "CHANNELS") => self.joints[at].channels = self.channels()?,
            (Some(Open::Joint(at)), "JOINT") => self.begin_joint(word, Some(at))?,
            (Some(Open::Joint(at)), "END") => {
                self.keyword("Site")?;
                self.name()?;
                self.open.push(Open::EndSite(at));
            }
            (Some(Open::Joint(_)), _) => {
                return Err(word.instead_of("OFFSET, CHANNELS, JOINT, End Site or }"));
            }
            (Some(Open::EndSite(at)), "OFFSET") => {
                let offset = self.offset()?;
                self.joints[at].end_sites.push(offset);
            }
            (Some(Open::EndSite(_)), _) => return Err(word.instead_of("OFFSET or }")),
        }
        Ok(())
    }

    fn begin_joint(&mut self, word: Word, parent: Option<usize>) -> Result<(), BvhError> {
        let name = self.name()?;
        if name.is_empty() {
            return Err(BvhError::word(word.line, "a name", "{"));
        }
        let (offset, channels, end_sites) = ([0.0; 3], Vec::new(), Vec::new());
        self.open.push(Open::Joint(self.joints.len()));
        self.joints.push(BvhJoint { name, parent, offset, channels, end_sites });
        Ok(())
    }

    fn channels(&mut self) -> Result<Vec<Channel>, BvhError> {
        let n: usize = self.parsed("a number of channels", |text| text.parse().ok())?;
        let named = |text: &str| {
            let mut names = Channel::NAMES.into_iter();
            Some(names.find(|(_, name)| text.eq_ignore_ascii_case(name))?.0)
        };
        (0..n).map(|_| self.parsed("a channel such as Xrotation or Yposition", named)).collect()
    }

    fn offset(&mut self) -> Result<Point, BvhError> {
        let mut number = || self.parsed("a number of the OFFSET", finite);
        Ok([number()?, number()?, number()?])
    }

    /// All words up to an opening brace, joined by blanks; the brace is taken too.
    fn name(&mut self) -> Result<String, BvhError> {
        let mut name = Vec::new();
        loop {
            match self.take("a name and {")?.text {
                "{" => return Ok(name.join(" ")),
                word => name.push(word),
            }
        }
    }

    fn keyword(&mut self, keyword: &str) -> Result<(), BvhError> {
        self.parsed(keyword, |text| text.eq_ignore_ascii_case(keyword).then_some(()))
    }

    /// The meaning of the next word.
    fn parsed<T>(
        &mut self,
        expected: &str,
        parse: impl Fn(&str) -> Option<T>,
    ) -> Result<T, BvhError> {
        let word = self.take(expected)?;
        parse(word.text).ok_or_else(|| word.instead_of(expected))
    }

    /// The next word; `expected` is named in the error.
    fn take(&mut self, expected: &str) -> Result<Word<'a>, BvhError> {
        self.words.next().ok_or_else(|| BvhError::end(self.n_lines, expected))
    }
}

/// A number that is neither NaN nor infinite.
fn finite(text: &str) -> Option<f64> {
    text.parse().ok().filter(|value: &f64| value.is_finite())
}

/// Seconds from frame to frame, and the frames' numbers, from the line with index `first` on.
fn frames(lines: &[&str], first: usize, width: usize) -> Result<(f64, Vec<Vec<f64>>), BvhError> {
    let numbered = lines.iter().enumerate().skip(first).map(|(index, &line)| (index + 1, line));
    let mut left = numbered.filter(|(_, line)| !line.trim().is_empty());
    let mut next = |expected| left.next().ok_or_else(|| BvhError::end(lines.len(), expected));
    let (line, text) = next(FRAMES)?;
    let said: usize = value(text, "Frames", FRAMES, line, |text| text.parse().ok())?;
    let (time_line, text) = next(TIME)?;
    let positive = |text: &str| finite(text).filter(|&seconds| seconds >= SHORTEST_S);
    let frame_time_s = value(text, "Frame Time", TIME, time_line, positive)?;
    let frames: Vec<Vec<f64>> =
        left.map(|(line, text)| frame(text, line, width)).collect::<Result<_, _>>()?;
    if frames.len() != said {
        return Err(BvhError::FrameCount { line, said, found: frames.len() });
    }
    Ok((frame_time_s, frames))
}

const FRAMES: &str = "\"Frames:\" and a count";
/// Seconds of a frame that the decimals of a file can tell from zero.
const SHORTEST_S: f64 = 1e-8;
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

fn frame(text: &str, line: usize, width: usize) -> Result<Vec<f64>, BvhError> {
    let number = |word: &str| finite(word).ok_or_else(|| BvhError::word(line, "a number", word));
    let frame: Vec<f64> = text.split_whitespace().map(number).collect::<Result<_, _>>()?;
    if frame.len() != width {
        return Err(BvhError::FrameLength { line, expected: width, found: frame.len() });
    }
    Ok(frame)
}
