//! The part from HIERARCHY to MOTION.

use super::words::{Word, Words};
use crate::motion::bvh::error::BvhError;
use crate::motion::bvh::hierarchy::{BvhJoint, Channel};

/// What a brace was opened for.
#[derive(Clone, Copy)]
enum Open {
    Joint(usize),
    EndSite(usize),
}

/// The joints of a hierarchy, in the order of the text.
pub fn parse(lines: &[&str]) -> Result<Vec<BvhJoint>, BvhError> {
    let mut hierarchy = Hierarchy { words: Words::of(lines), joints: Vec::new(), open: Vec::new() };
    hierarchy.words.keyword("HIERARCHY")?;
    while !hierarchy.words.is_empty() {
        hierarchy.statement()?;
    }
    let missing = match (hierarchy.open.is_empty(), hierarchy.joints.is_empty()) {
        (false, _) => "}",
        (true, true) => "ROOT",
        (true, false) => return Ok(hierarchy.joints),
    };
    Err(BvhError::end(lines.len(), missing))
}

struct Hierarchy<'a> {
    words: Words<'a>,
    joints: Vec<BvhJoint>,
    /// Open braces, the outermost first.
    open: Vec<Open>,
}

impl Hierarchy<'_> {
    fn statement(&mut self) -> Result<(), BvhError> {
        let word = self.words.take("a statement")?;
        match self.open.last().copied() {
            None if word.is("ROOT") => self.begin_joint(word, None),
            None => Err(word.instead_of("ROOT or MOTION")),
            Some(Open::Joint(joint)) => self.in_joint(word, joint),
            Some(Open::EndSite(joint)) => self.in_end_site(word, joint),
        }
    }

    fn in_joint(&mut self, word: Word, joint: usize) -> Result<(), BvhError> {
        if word.is("OFFSET") {
            self.joints[joint].offset = self.words.triple()?;
        } else if word.is("CHANNELS") {
            self.joints[joint].channels = self.channels()?;
        } else if word.is("JOINT") {
            return self.begin_joint(word, Some(joint));
        } else if word.is("End") {
            self.words.keyword("Site")?;
            self.words.name()?;
            self.open.push(Open::EndSite(joint));
        } else if word.text == "}" {
            self.open.pop();
        } else {
            return Err(word.instead_of("OFFSET, CHANNELS, JOINT, End Site or }"));
        }
        Ok(())
    }

    fn in_end_site(&mut self, word: Word, joint: usize) -> Result<(), BvhError> {
        if word.is("OFFSET") {
            let offset = self.words.triple()?;
            self.joints[joint].end_sites.push(offset);
        } else if word.text == "}" {
            self.open.pop();
        } else {
            return Err(word.instead_of("OFFSET or }"));
        }
        Ok(())
    }

    fn begin_joint(&mut self, word: Word, parent: Option<usize>) -> Result<(), BvhError> {
        let name = self.words.name()?;
        if name.is_empty() {
            return Err(BvhError::word(word.line, "a name", "{"));
        }
        let (offset, channels, end_sites) = ([0.0; 3], Vec::new(), Vec::new());
        self.open.push(Open::Joint(self.joints.len()));
        self.joints.push(BvhJoint { name, parent, offset, channels, end_sites });
        Ok(())
    }

    fn channels(&mut self) -> Result<Vec<Channel>, BvhError> {
        const COUNT: &str = "a number of channels";
        let count = self.words.take(COUNT)?;
        let n: usize = count.text.parse().map_err(|_| count.instead_of(COUNT))?;
        (0..n).map(|_| self.channel()).collect()
    }

    fn channel(&mut self) -> Result<Channel, BvhError> {
        const NAME: &str = "a channel such as Xrotation or Yposition";
        let word = self.words.take(NAME)?;
        let found = Channel::NAMES.into_iter().find(|(_, name)| word.is(name));
        found.map(|(channel, _)| channel).ok_or_else(|| word.instead_of(NAME))
    }
}
