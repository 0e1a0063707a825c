//! SwiGLU over rows of `[gate | up]`.

use super::lanes::{LANES, Lanes, vectorised};
use super::maths::sigmoid;

vectorised! {
    /// silu(gate) up for rows `[gate | up]` of `2 f` columns: `[n, f]`.
    pub fn forward(gate_up: &[f32], f: usize) -> Vec<f32> {
        let mut output = vec![0.0; gate_up.len() / 2];
        for (row, output) in gate_up.chunks_exact(2 * f).zip(output.chunks_exact_mut(f)) {
            let (gate, up) = row.split_at(f);
            let operands = gate.chunks(LANES).zip(up.chunks(LANES));
            for (output, (gate, up)) in output.chunks_mut(LANES).zip(operands) {
                let gate = L::read(gate);
                gate.mul(sigmoid(gate)).mul(L::read(up)).write(output);
            }
        }
        output
    }
}

vectorised! {
    /// Turns `[gate | up]` into the gradient by it, given the gradient by the output `[n, f]`.
    pub fn backward(gate_up: &mut [f32], grad_output: &[f32], f: usize) {
        for (row, gradient) in gate_up.chunks_exact_mut(2 * f).zip(grad_output.chunks_exact(f)) {
            let (gate, up) = row.split_at_mut(f);
            let operands = gate.chunks_mut(LANES).zip(up.chunks_mut(LANES));
            for ((gate, up), gradient) in operands.zip(gradient.chunks(LANES)) {
                let (by_gate, by_up) = differentiate(L::read(gate), L::read(up), L::read(gradient));
                by_gate.write(gate);
                by_up.write(up);
            }
        }
    }
}

/// Gradients by gate and up: g up σ (1 + gate (1 − σ)) and g gate σ.
#[inline(always)]
fn differentiate<L: Lanes>(gate: L, up: L, gradient: L) -> (L, L) {
    let sigmoid = sigmoid(gate);
    let silu = gate.mul(sigmoid);
    let slope = sigmoid.mul(L::splat(1.0).add(gate).sub(silu));
    (gradient.mul(up).mul(slope), gradient.mul(silu))
}
