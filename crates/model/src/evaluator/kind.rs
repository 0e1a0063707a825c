//! [`Networks`]: what a kind of evaluator does.
//!
//! Shapes: n sequences, e numbers of an embedding.

use burn::tensor::Tensor;
use rand_chacha::ChaCha8Rng;

use super::pool::Pairs;
use super::rows::Rows;

/// Motions and captions into vectors that are near each other where they belong together.
pub trait Networks {
    /// A vector of each motion, `[n, e]`.
    fn motions(&self, rows: &Rows) -> Tensor<2>;

    /// A vector of each caption, `[n, e]`.
    fn captions(&self, rows: &Rows) -> Tensor<2>;

    /// How badly motions and captions of a batch find one another, `[1]`: in training, with what is left
    /// out drawn from `rng`.
    fn loss(&self, pairs: &Pairs, rng: Option<&mut ChaCha8Rng>) -> Tensor<1>;
}
