//! Networks of an evaluator: a folder a kind.
//!
//! [`AnyNetworks::init`] is the one place that tells kinds apart.

use std::ops::Deref;

use burn::module::Module;
use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;

use super::kind::Networks;
use super::matching::MatchingNetworks;
use super::motion_clip::Towers;
use crate::spec::{EvaluatorSpec, NetworksSpec};

/// Networks of any kind, as a module.
#[derive(Module, Debug)]
#[expect(clippy::large_enum_variant, reason = "an evaluator holds one, and never many in a row")]
pub enum AnyNetworks {
    MotionClip(Towers),
    Matching(MatchingNetworks),
}

impl AnyNetworks {
    /// Draws parameters, for motions of `n_features` features a frame.
    pub fn init(
        spec: &EvaluatorSpec,
        n_features: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        match &spec.networks {
            NetworksSpec::MotionClip(sizes) => {
                Self::MotionClip(Towers::init(spec, sizes, n_features, rng, device))
            }
            NetworksSpec::Matching(sizes) => {
                Self::Matching(MatchingNetworks::init(spec, sizes, n_features, rng, device))
            }
        }
    }
}

impl Deref for AnyNetworks {
    type Target = dyn Networks;

    fn deref(&self) -> &Self::Target {
        match self {
            Self::MotionClip(towers) => towers,
            Self::Matching(networks) => networks,
        }
    }
}
