//! [`MatchingNetworks`]: all parameters of an evaluator of this kind.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;

use super::margin::margin_loss;
use super::movement::Movement;
use super::order::Order;
use super::reader::Reader;
use crate::evaluator::kind::Networks;
use crate::evaluator::pool::Pairs;
use crate::evaluator::rows::Rows;
use crate::spec::{EvaluatorSpec, MatchingSpec};

/// All parameters of an evaluator of this kind.
#[derive(Module, Debug)]
pub struct MatchingNetworks {
    movement: Movement,
    motion: Reader,
    caption: Reader,
    #[module(skip)]
    sizes: MatchingSpec,
}

impl MatchingNetworks {
    /// Draws parameters, for motions of `n_features` features a frame.
    pub fn init(
        spec: &EvaluatorSpec,
        sizes: &MatchingSpec,
        n_features: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let MatchingSpec { width, dropout, .. } = *sizes;
        Self {
            movement: Movement::init(n_features, width, dropout, rng, device),
            motion: Reader::init([width, 2 * width, spec.dim], rng, device),
            caption: Reader::init([spec.word_dim, width, spec.dim], rng, device),
            sizes: sizes.clone(),
        }
    }

    fn moved(&self, rows: &Rows, rng: Option<&mut ChaCha8Rng>) -> Tensor<2> {
        let longest = rows.lengths.iter().copied().max().unwrap_or(0);
        let order = Order::padded(&rows.lengths, longest);
        self.motion.read(self.movement.rows(rows, rng), &order)
    }
}

impl Networks for MatchingNetworks {
    fn motions(&self, rows: &Rows) -> Tensor<2> {
        self.moved(rows, None)
    }

    fn captions(&self, rows: &Rows) -> Tensor<2> {
        let n_rows = rows.lengths.iter().sum::<usize>();
        let shape = [n_rows, rows.values.len() / n_rows];
        let words = TensorData::new(rows.values.clone(), shape);
        let words = Tensor::from_data(words, &self.caption.device());
        self.caption.read(words, &Order::packed(&rows.lengths))
    }

    fn loss(&self, pairs: &Pairs, rng: Option<&mut ChaCha8Rng>) -> Tensor<1> {
        let motions = self.moved(&pairs.motions, rng);
        let captions = self.captions(&pairs.captions);
        let MatchingSpec { margin, mismatches, .. } = self.sizes;
        margin_loss(&motions, &captions, &pairs.caption_ids, margin, mismatches)
    }
}
