//! [`EvaluatorFeatures`]: the features of a frame that an evaluator sees.

use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::units::number::plain;

plain!(EvaluatorFeatures);

/// Features of a frame that an evaluator sees.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum EvaluatorFeatures {
    /// All 263 of HumanML3D, as the motion has them.
    Full,
    /// The first 67: the root and the positions of the joints.
    Meng67,
    /// The first 259: all but the contacts of the feet, which Guo et al. leave out.
    NoContacts,
    /// These, and the velocities, contacts and accelerations of the joints, which are computed from them.
    #[default]
    Moving,
}

/// Accelerations of the joints.
const ACCELERATIONS: usize = 66;

impl EvaluatorFeatures {
    /// The columns that are seen, out of `all`.
    pub fn columns(self, all: usize) -> [Range<usize>; 2] {
        match self {
            Self::Full => [0..all, all..all],
            Self::Meng67 => [0..all.min(67), all..all],
            Self::NoContacts => [0..all.min(259), all..all],
            Self::Moving => [0..all.min(67), all.min(193)..all],
        }
    }

    /// The number of features, with accelerations behind the columns.
    pub fn n_features(self, all: usize) -> usize {
        let columns = self.columns(all).into_iter().map(|columns| columns.len()).sum::<usize>();
        if self == Self::Moving { columns + ACCELERATIONS } else { columns }
    }
}
