//! [`Representation`]: the features of a frame that a tokenizer reads and makes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Features of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Representation {
    /// All 263 of HumanML3D.
    #[default]
    Full,
    /// The first 67, the root and the positions of the joints (Meng et al. 2024, LG-Tok). Rotations,
    /// velocities and contacts of what is made follow from the positions.
    Meng67,
}

impl Representation {
    /// How many of `all` features there are.
    pub fn n_features(self, all: usize) -> usize {
        match self {
            Self::Full => all,
            Self::Meng67 => all.min(67),
        }
    }
}
