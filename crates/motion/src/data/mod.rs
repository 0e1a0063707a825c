//! Clips with captions, from a folder in the HumanML3D layout or from the procedural generator.
//!
//! # Example
//!
//! ```
//! use isoflop_motion::data::{self, Split};
//! use isoflop_motion::motion::N_FEATURES;
//! use isoflop_spec::spec::{Clips, DataSection};
//!
//! // The built-in procedural motion: eight clips to train on.
//! let section = DataSection { clips: Clips::Count(8), ..DataSection::default() };
//! let source = data::open(&section, None)?;
//! assert_eq!(source.n_clips(Split::Train), 8);
//! let features = source.features(Split::Train, 0)?;
//! assert_eq!(features.len(), source.n_frames(Split::Train, 0) * N_FEATURES);
//! println!("{}", source.captions(Split::Train, 0)[0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod clips;
mod facts;
mod humanml3d;
pub mod import;
mod look;
mod motion_files;
mod npy;
mod other_sources;
mod source;
mod summary;
mod texts;

pub use clips::LengthRule;
pub use facts::{Checked, Counted, LENGTH_BIN, Tally, WORDS_BIN, check_folder, count, test_groups};
pub use humanml3d::{HumanMl3d, HumanMl3dOptions};
pub use look::{Finding, Found, Held, Look, Seen, look};
pub use motion_files::{FPS, read_motion};
pub use npy::{NpyArray, NpyProblem, parse_npy, write_npy};
pub use other_sources::{Procedural, ProceduralOptions, Union};
pub use source::{
    DataError, FAR, FEATURE_GROUPS, FeatureStats, Member, Metadata, MotionSource, Split,
    StatsAccumulator, UNIT_FRAMES,
};
pub use summary::{DataFacts, Demand, MemberFacts};
pub use texts::{Annotation, CaptionProblem, parse_annotation};

use std::path::Path;

use crate::spec::{Clips, DataSection, MemberSection, Origin};
use other_sources::NoMotion;

/// Clips looked at to estimate the tokens of an average one.
const SAMPLE: usize = 256;

/// Opens the data of a sweep; `demand` of its longest run is for `clips: auto`.
///
/// # Errors
/// The data cannot be read, or cannot be used.
pub fn open(
    spec: &DataSection,
    demand: Option<&Demand>,
) -> Result<Box<dyn MotionSource>, DataError> {
    match spec.origin() {
        Origin::Procedural => Ok(Box::new(procedural(spec, demand))),
        Origin::None => Ok(Box::new(NoMotion::default())),
        Origin::Folder(path) => Ok(Box::new(folder(spec, path, spec.fps)?)),
        Origin::Union(members) => {
            let member = |section: &MemberSection| {
                let source = Box::new(folder(spec, &section.path, section.fps.or(spec.fps))?);
                Ok(Member { name: section.name(), licence: section.licence.clone(), source })
            };
            let members = members.iter().map(member).collect::<Result<_, DataError>>()?;
            Ok(Box::new(Union::new(members)?))
        }
    }
}

fn folder(spec: &DataSection, path: &Path, fps: Option<f64>) -> Result<HumanMl3d, DataError> {
    let DataSection { mirror, broken, long_clips, .. } = *spec;
    let others = HumanMl3dOptions::default();
    HumanMl3d::open(path, &HumanMl3dOptions { mirror, broken, long_clips, fps, ..others })
}

fn procedural(spec: &DataSection, demand: Option<&Demand>) -> Procedural {
    let DataSection { seed, val_clips, test_clips, .. } = *spec;
    let with = |train_clips| {
        Procedural::new(ProceduralOptions { seed, train_clips, val_clips, test_clips })
    };
    match spec.clips {
        Clips::Count(train_clips) => with(train_clips),
        Clips::Auto => with(demand.map_or(SAMPLE, |demand| clips_for(&with(SAMPLE), demand))),
    }
}

/// A power of two, so that small changes of a sweep leave its data as they are.
fn clips_for(sample: &dyn MotionSource, Demand { targets, codes }: &Demand) -> usize {
    let n = sample.n_clips(Split::Train);
    let sampled: usize = (0..n).map(|i| codes.n_targets(sample.n_frames(Split::Train, i))).sum();
    (targets * n).div_ceil(sampled.max(1)).next_power_of_two().max(SAMPLE)
}
