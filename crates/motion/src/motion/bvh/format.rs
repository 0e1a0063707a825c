//! [`Bvh`] as the text of a file.

use std::fmt::{self, Display, Formatter};

use super::hierarchy::{Bvh, BvhJoint, Channel};

/// Decimals of offsets and channels: a micrometre, or a micrometre at a metre from the joint.
pub const DECIMALS: usize = 4;

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
    (value * scale).round() / scale + 0.0
}
