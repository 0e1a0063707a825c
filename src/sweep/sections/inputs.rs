//! What a sweep trains on: the `data`, `text` and `tokenizer` sections.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::spec::KeyProblem;
use crate::units::number;

/// Where motion comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum DataSource {
    /// The built-in seeded generator: never ends, needs no file.
    #[default]
    Procedural,
    /// A folder in the HumanML3D layout.
    HumanMl3d,
    /// No motion and no tokenizers: a trainer of one's own brings its data.
    None,
}

/// The number of training clips of the procedural source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Clips {
    /// A given number.
    Count(usize),
    /// As many as the longest run needs, rounded up to a power of two.
    #[default]
    Auto,
}

/// What to do about files that are not what they should be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum BrokenFiles {
    /// Leave them out, with a warning each.
    #[default]
    Skip,
    /// Stop with an error that lists them all.
    Refuse,
}

/// The `data` section: the motion and the captions that are learned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DataSection {
    pub source: DataSource,
    /// The folder of `humanml3d`, from the working folder.
    pub path: Option<std::path::PathBuf>,
    /// `humanml3d`: every training clip also left-right mirrored.
    pub mirror: bool,
    /// `humanml3d`: what to do about files that are not what they should be.
    pub broken: BrokenFiles,
    /// `procedural`: the generator's seed.
    pub seed: u64,
    /// `procedural`: clips to train on, or `auto`.
    pub clips: Clips,
    /// `procedural`: clips to validate on.
    #[serde(deserialize_with = "number::count")]
    pub val_clips: usize,
    /// `procedural`: clips to test on.
    #[serde(deserialize_with = "number::count")]
    pub test_clips: usize,
}

impl Default for DataSection {
    fn default() -> Self {
        Self {
            source: DataSource::default(),
            path: None,
            mirror: true,
            broken: BrokenFiles::default(),
            seed: 0,
            clips: Clips::default(),
            val_clips: 128,
            test_clips: 512,
        }
    }
}

impl DataSection {
    /// What no source can use.
    pub fn problems(&self) -> Vec<KeyProblem> {
        let problem = |field, problem, help| KeyProblem { field, problem, help };
        let mut problems = Vec::new();
        if self.source == DataSource::HumanMl3d && self.path.is_none() {
            let help = "path: the folder that holds new_joint_vecs, texts and train.txt";
            problems.push(problem("", "`source: humanml3d` needs a `path`", Some(help)));
        }
        if self.clips == Clips::Count(0) {
            problems.push(problem("clips", "no clip to train on", None));
        }
        if self.val_clips == 0 || self.test_clips == 0 {
            problems.push(problem("", "`val_clips` and `test_clips` must be at least 1", None));
        }
        problems
    }
}
