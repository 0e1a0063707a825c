//! SwiGLU over rows of `[gate | up]`.

use super::lanes::{LANES, Lanes, vectorised};
use super::maths::sigmoid;

vectorised! {
    /// silu(gate) up for rows `[gate | up]` of `2 f` columns, into `output` `[n, f]`.
    pub fn forward(gate_up: &[f32], f: usize, output: &mut [f32]) {
        for (row, output) in gate_up.chunks_exact(2 * f).zip(output.chunks_exact_mut(f)) {
            let (gate, up) = row.split_at(f);
            let operands = gate.chunks(LANES).zip(up.chunks(LANES));
            for (output, (gate, up)) in output.chunks_mut(LANES).zip(operands) {
                let gate = L::read(gate);
                gate.mul(sigmoid(gate)).mul(L::read(up)).write(output);
            }
        }
    }
}

vectorised! {
    /// The gradient by `[gate | up]`, into `change`; turns that by the output into the output.
    pub fn backward(gate_up: &[f32], f: usize, change: &mut [f32], output: &mut [f32]) {
        let rows = gate_up.chunks_exact(2 * f).zip(change.chunks_exact_mut(2 * f));
        for ((row, change), output) in rows.zip(output.chunks_exact_mut(f)) {
            let ((gate, up), (by_gate, by_up)) = (row.split_at(f), change.split_at_mut(f));
            let from = gate.chunks(LANES).zip(up.chunks(LANES));
            let to = by_gate.chunks_mut(LANES).zip(by_up.chunks_mut(LANES));
            for (((gate, up), (by_gate, by_up)), output) in
                from.zip(to).zip(output.chunks_mut(LANES))
            {
                let operands = [L::read(gate), L::read(up), L::read(output)];
                let by = differentiate(operands);
                by[0].write(by_gate);
                by[1].write(by_up);
                by[2].write(output);
            }
        }
    }
}

/// Gradients by gate and up, g up σ (1 + gate (1 − σ)) and g gate σ, and the output.
#[inline(always)]
fn differentiate<L: Lanes>([gate, up, gradient]: [L; 3]) -> [L; 3] {
    let sigmoid = sigmoid(gate);
    let silu = gate.mul(sigmoid);
    let slope = sigmoid.mul(L::splat(1.0).add(gate).sub(silu));
    [gradient.mul(up).mul(slope), gradient.mul(silu), silu.mul(up)]
}
