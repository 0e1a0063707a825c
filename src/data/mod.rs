//! Clips with captions, from a folder in the HumanML3D layout or from the procedural generator.

mod captions;
mod clip_file;
mod digest;
mod facts;
#[cfg(test)]
mod fixtures;
mod humanml3d;
mod items;
mod no_motion;
mod npy;
mod open;
mod procedural;
mod source;
mod splits;
mod stats;

pub use captions::{Annotation, CaptionProblem, parse_annotation};
pub use facts::DataFacts;
pub use humanml3d::{HumanMl3d, HumanMl3dOptions};
pub use npy::{NpyArray, NpyProblem, parse_npy};
pub use open::open;
pub use procedural::{Procedural, ProceduralOptions};
pub use source::{DataError, FRAMES_PER_TOKEN, FeatureStats, MotionSource, Split};
pub use stats::{FEATURE_GROUPS, StatsAccumulator};
