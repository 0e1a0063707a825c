//! [`Towers`]: the tower of motions and the tower of captions.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::contrast::contrast;
use super::tower::Tower;
use crate::evaluator::kind::Networks;
use crate::evaluator::pool::Pairs;
use crate::evaluator::rows::Rows;
use crate::learn::params::constant;
use crate::spec::{EvaluatorSpec, MotionClipSpec};

/// 1 / 0.07, by which cosines are multiplied at first (Radford et al. 2021).
const FIRST_SCALE: f64 = 1.0 / 0.07;

/// All parameters of an evaluator of this kind.
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
        sizes: &MotionClipSpec,
        n_features: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let mut tower = |channels| Tower::init(spec, sizes, channels, rng, device);
        Self {
            motion: tower(sizes.frames * n_features),
            caption: tower(spec.word_dim),
            log_scale: constant([1], FIRST_SCALE.ln() as f32, device),
        }
    }
}

impl Networks for Towers {
    fn motions(&self, rows: &Rows) -> Tensor<2> {
        self.motion.embed(rows)
    }

    fn captions(&self, rows: &Rows) -> Tensor<2> {
        self.caption.embed(rows)
    }

    fn loss(&self, pairs: &Pairs, _rng: Option<&mut ChaCha8Rng>) -> Tensor<1> {
        let motions = self.motion.embed(&pairs.motions);
        let captions = self.caption.embed(&pairs.captions);
        contrast(motions, captions, self.log_scale.val(), &pairs.caption_ids)
    }
}
