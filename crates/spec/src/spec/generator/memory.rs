//! Peak memory of a run, from its shape.

use super::shape::{Ffn, ModelShape, ParamCounts};

/// Targets a forward pass of evaluation at most, but for a single clip.
pub const TARGETS_PER_PASS: usize = 2048;

/// What the runtime of a worker takes before it holds a model.
const BASE_BYTES: f64 = 26e6;

/// Positions trained or measured for each target: prefixes come on top.
const POSITIONS_PER_TARGET: f64 = 1.8;

/// What memory takes beyond what is asked for, since lengths are rounded up: of what is kept for the
/// backward pass, and of what comes and goes while a split is measured.
const ROUNDED: f64 = 1.1;
const ROUNDED_MEASURED: f64 = 1.5;

/// Floats for each parameter: weights, gradients, both moments, the new weights, and panels.
const FLOATS_PER_PARAMETER: f64 = 5.5;

/// Rows of which the head holds the logits at once.
const HEAD_ROWS: f64 = 256.0;

/// Peak bytes that a training process has to itself; files that it maps are shared, and left out.
///
/// Weights, gradients, both moments and the new weights; the head's weights in panels, both ways
/// round; what the backward pass keeps of each block for its rows (the inputs of both halves,
/// queries, keys and values, what attention mixed and two numbers a head, the columns before the
/// activation); one block's for the rows that are measured together; a few rows' logits.
///
/// Measured on 173 runs of widths 8 to 256, 64 to 64,000 codes and batches of 64 to 2048: 23 to
/// 341 MB, 0.72 to 1.31 of it predicted, 94 % of them within 20 %. What is off is runs of less than
/// 55 MB, by pieces that the allocator keeps.
pub fn peak_bytes(
    shape: &ModelShape,
    n_vocab: usize,
    params: ParamCounts,
    batch_tokens: usize,
) -> u64 {
    let targets = batch_tokens as f64;
    let d = shape.d_model as f64;
    let before = match shape.ffn {
        Ffn::SwiGlu => 2.0 * shape.d_ff as f64,
        Ffn::Gelu => shape.d_ff as f64,
    };
    let block = 6.0 * d + before + 2.0 * shape.n_head as f64;
    let kept = shape.n_layer as f64 * block + 4.0 * d;
    let trained = ROUNDED * POSITIONS_PER_TARGET * targets * kept;
    let measured = ROUNDED_MEASURED * POSITIONS_PER_TARGET * TARGETS_PER_PASS as f64 * block;
    let head = 2.0 * d * n_vocab as f64 + targets.min(HEAD_ROWS) * n_vocab as f64;
    let parameters = FLOATS_PER_PARAMETER * params.total() as f64;
    (BASE_BYTES + 4.0 * (trained + measured + head + parameters)) as u64
}
