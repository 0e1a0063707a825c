//! [`Towers`]: the tower of motions and the tower of captions.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::contrast::contrast;
use super::pool::Pairs;
use super::tower::{Frame, Tower};
use crate::learn::params::constant;
use crate::spec::EvaluatorSpec;

/// 1 / 0.07, by which cosines are multiplied at first (Radford et al. 2021).
const FIRST_SCALE: f64 = 1.0 / 0.07;

/// All parameters of an evaluator.
#[derive(Module, Debug)]
pub struct Towers {
    motion: Tower,
    caption: Tower,
    /// The logarithm of what cosines are multiplied by, `[1]`.
    log_scale: Param<Tensor<1>>,
}

impl Towers {
    /// Draws parameters, for motions of `n_features` features a frame.
    pub fn init(
        spec: &EvaluatorSpec,
        n_features: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        Self {
            motion: Tower::init(spec, spec.frames * n_features, rng, device),
            caption: Tower::init(spec, spec.word_dim, rng, device),
            log_scale: constant([1], FIRST_SCALE.ln() as f32, device),
        }
    }

    /// The tower of motions.
    pub fn motion(&self) -> &Tower {
        &self.motion
    }

    /// The tower of captions.
    pub fn caption(&self) -> &Tower {
        &self.caption
    }

    /// How badly motions and captions of a batch find one another, in nats, `[1]`.
    pub fn loss(&self, pairs: &Pairs, frame: &Frame) -> Tensor<1> {
        let motions = self.motion.embed(&pairs.motions, frame);
        let captions = self.caption.embed(&pairs.captions, frame);
        contrast(motions, captions, self.log_scale.val(), &pairs.caption_ids)
    }
}
