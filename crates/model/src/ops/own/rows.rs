//! Picking rows of a matrix, for embeddings and for the rows that a loss is taken on.

use super::buffers::Buffer;

/// Rows `rows` of `x` `[m, d]`, in their order: `[n, d]`.
pub fn forward(x: &[f32], rows: &[u32], d: usize) -> Buffer {
    let mut output = Buffer::new(rows.len() * d);
    for (&row, to) in rows.iter().zip(output.chunks_exact_mut(d)) {
        to.copy_from_slice(&x[row as usize * d..][..d]);
    }
    output
}

/// Gradient by `x` `[m, d]`: each row of the gradient by the output is added to the row it came
/// from, in the order of the output.
pub fn backward(grad_output: &[f32], rows: &[u32], m: usize, d: usize) -> Buffer {
    let mut gradient = Buffer::zeros(m * d);
    for (&row, from) in rows.iter().zip(grad_output.chunks_exact(d)) {
        for (to, from) in gradient[row as usize * d..][..d].iter_mut().zip(from) {
            *to += from;
        }
    }
    gradient
}
