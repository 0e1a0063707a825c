//! Peak memory of a run, from its shape.

use super::shape::{ModelShape, ParamCounts};
use crate::train::{LOGITS_PER_PASS, TARGETS_PER_PASS};

/// Code, runtime and mapped files of a worker before it holds a model.
const BASE_BYTES: f64 = 48e6;

/// Positions trained for each supervised token: prefixes come on top.
const POSITIONS_PER_TARGET: f64 = 1.4;

/// Floats of an evaluation pass: its logits, and a copy of them on the host.
fn evaluation_floats(n_vocab: usize) -> f64 {
    let outputs = n_vocab + 1;
    2.0 * (TARGETS_PER_PASS.min(LOGITS_PER_PASS / outputs).max(1) * outputs) as f64
}

/// Peak resident bytes of a training process.
///
/// Weights, gradients and both moments; then the larger of an evaluation pass and of a step: what
/// the backward pass keeps of each block (inputs of norms and products, RoPE'd queries and keys,
/// attention weights) for its rows, and the logits with their gradient.
pub fn peak_bytes(
    shape: &ModelShape,
    n_vocab: usize,
    params: ParamCounts,
    batch_tokens: usize,
) -> u64 {
    let targets = batch_tokens as f64;
    let rows = targets * POSITIONS_PER_TARGET;
    let d = shape.d_model as f64;
    let attention = shape.n_head as f64 * shape.n_ctx as f64;
    let block = 12.0 * d + 4.0 * shape.d_ff as f64 + attention;
    let activations = rows * shape.n_layer as f64 * block + rows * 6.0 * d;
    let logits = targets * 3.0 * n_vocab as f64;
    let parameters = 6.0 * params.total() as f64;
    let step = (activations + logits).max(evaluation_floats(n_vocab));
    (BASE_BYTES + 4.0 * (parameters + step)) as u64
}
