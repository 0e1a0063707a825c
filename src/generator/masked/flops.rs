//! Forward FLOPs of a step of the first stage.

use super::batch::Hidden;
use crate::generator::autoregressive::Batch;
use crate::spec::ModelShape;
use crate::spec::flops::exact_whole;

/// Multiply-adds of a batch of clips, times two: each clip at its own length, the head per target.
pub fn forward_flops(shape: &ModelShape, n_vocab: usize, clips: &[Hidden], batch: &Batch) -> f64 {
    let blocks = clips.iter().enumerate().map(|(i, clip)| {
        let n = clip.shown.len();
        exact_whole(shape, n_vocab, batch.layout.len(i) - n, n, 0)
    });
    let heads = 2.0 * (batch.targets.len() * shape.d_model * (n_vocab + 1)) as f64;
    blocks.sum::<f64>() + heads
}
