//! [`Finding`]: what may be wrong with motion that can be read; [`Found`]: a finding with the motions that have it.

use std::fmt;
use std::ops::Range;

use crate::motion::retarget::Up;

/// What may be wrong with motion, told as a sentence that says how to mend it.
#[derive(Clone, Debug, PartialEq)]
pub enum Finding {
    /// The legs are so many times as long as the target's.
    Scale(f64),
    /// The body stands along an axis that is not y; `None` between two.
    Lies(Option<Up>),
    /// The toes are behind the ankles.
    Backwards,
    /// One pose fills so many frames.
    Still(usize),
    /// The features are so many deviations from their mean, on the mean over all.
    Far(f64),
    /// Bones are not as long as HumanML3D's.
    Bones,
    /// The lowest joint is not on the floor.
    Floor,
    /// Two clips of a split are one motion.
    Twice,
    /// A clip outside training is one of training.
    Leak,
    /// The mirror image of a clip outside training is one of training.
    ImageLeak,
    /// The mean of some columns is so many deviations from that of the training clips.
    Mean(Range<usize>, f64),
    /// The deviation of some columns is so many times that of the training clips.
    Std(Range<usize>, f64),
}

impl Finding {
    /// Whether nothing else is said of a motion that has it: all else follows from it.
    pub fn is_gross(&self) -> bool {
        matches!(self, Self::Scale(_) | Self::Lies(_) | Self::Backwards)
    }

    /// Whether motion that has it can be used as well as any other.
    pub fn is_minor(&self) -> bool {
        matches!(self, Self::Bones | Self::Floor)
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Scale(factor) => write!(
                f,
                "the legs are {factor:.3} times as long as those of HumanML3D's body: joints are in metres, BVH is \
                 in centimetres, features are not normalised; `isoflop data import` reads other units and bodies"
            ),
            Self::Lies(along) => {
                let along =
                    along.map_or("between two axes".to_string(), |up| format!("along {up}"));
                write!(
                    f,
                    "the body lies {along} through most frames, where y is up: `isoflop data import` turns other \
                     axes; a body that does lie down is right"
                )
            }
            Self::Backwards => write!(
                f,
                "the toes are behind the ankles: the axes are left-handed, or left and right are exchanged; \
                 `isoflop data import --left-handed` mirrors such files"
            ),
            Self::Still(frames) => {
                write!(f, "one pose fills {frames} frames: the capture stands still; cut them out")
            }
            Self::Far(deviations) => write!(
                f,
                "the features are {deviations:.1} deviations from their mean, where most data are at 0.7: the mean \
                 and deviation are of other data, or the features are normalised already"
            ),
            Self::Bones => write!(f, "the bones are not as long as those of HumanML3D's body"),
            Self::Floor => write!(f, "the lowest joint is not at y = 0, where the floor is"),
            Self::Twice => write!(f, "one motion has two names: remove one of them"),
            Self::Leak => write!(
                f,
                "motion that is trained on is in another split too, so that losses there are too low: remove one \
                 of the two"
            ),
            Self::ImageLeak => write!(
                f,
                "the mirror image of motion that is trained on is in another split, so that losses there are too \
                 low: remove one of the two"
            ),
            Self::Mean(columns, deviations) => write!(
                f,
                "Mean.npy is {deviations:.1} deviations from the mean of the training clips in columns {}: it is \
                 of other data; without Mean.npy and Std.npy both are computed",
                shown(columns)
            ),
            Self::Std(columns, factor) => write!(
                f,
                "Std.npy is {factor:.3} times the deviation of the training clips in columns {}: it is of other \
                 data, or divided by a feature bias; without Mean.npy and Std.npy both are computed",
                shown(columns)
            ),
        }
    }
}

fn shown(columns: &Range<usize>) -> String {
    match columns.len() {
        1 => columns.start.to_string(),
        _ => format!("{} to {}", columns.start, columns.end - 1),
    }
}

/// A finding, and the motions that have it; none where it is of all.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// That of the first.
    pub finding: Finding,
    pub names: Vec<String>,
    /// Motions that were looked at.
    pub of: usize,
}

/// Motions that are named, at most.
const NAMED: usize = 3;

impl fmt::Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let named = self.names[..self.names.len().min(NAMED)].join(", ");
        match self.names.len() {
            0 => write!(f, "{}", self.finding),
            n if n <= NAMED => write!(f, "{named}: {}", self.finding),
            n => write!(f, "{named} and others, {n} of {} motions: {}", self.of, self.finding),
        }
    }
}
