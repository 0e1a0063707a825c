//! Peak memory of a run, from its shape.

use super::shape::{ModelShape, ParamCounts};
use crate::sweep::Ffn;

/// Code, runtime and mapped files of a worker before it holds a model.
const BASE_BYTES: f64 = 46e6;

/// Positions trained for each supervised token: prefixes come on top.
const POSITIONS_PER_TARGET: f64 = 1.8;

/// What buffers hold above what they are asked for, evaluation and fragments among it.
const SLACK: f64 = 1.2;

/// Rows of which the head holds the logits at once.
const HEAD_ROWS: f64 = 256.0;

/// Peak resident bytes of a training process.
///
/// Weights, gradients, both moments and the new weights; the head's weights in panels, both ways
/// round; what the backward pass keeps of each block for its rows (the inputs of both halves,
/// queries, keys and values, what attention mixed, its weights, the columns before the
/// activation); a few rows' logits.
pub fn peak_bytes(
    shape: &ModelShape,
    n_vocab: usize,
    params: ParamCounts,
    batch_tokens: usize,
) -> u64 {
    let targets = batch_tokens as f64;
    let rows = targets * POSITIONS_PER_TARGET;
    let d = shape.d_model as f64;
    let before = match shape.ffn {
        Ffn::SwiGlu => 2.0 * shape.d_ff as f64,
        Ffn::Gelu => shape.d_ff as f64,
    };
    let attention = shape.n_head as f64 * shape.n_ctx as f64;
    let block = 6.0 * d + before + attention;
    let activations = rows * (shape.n_layer as f64 * block + 4.0 * d);
    let head = 2.0 * d * n_vocab as f64 + targets.min(HEAD_ROWS) * n_vocab as f64;
    let parameters = 5.0 * params.total() as f64;
    (BASE_BYTES + 4.0 * SLACK * (activations + head + parameters)) as u64
}
