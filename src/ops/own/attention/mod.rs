//! Rotary, prefix-causal attention over packed sequences, one head of one sequence at a time.
//!
//! The mask lets a position see the first so many positions of its sequence and no others, so
//! each row of the score matrix is cut where it ends, and only what lies before the cut is
//! computed: about half of it for a causal sequence. Rows go through scores, softmax and product a
//! tile at a time, and the way back makes their weights again from two numbers a row.
//!
//! Rows of weights are zero from their cut to the end of the vector in which the longest row of their
//! tile is cut, and unspecified after it. That is enough: a tile reads no further than its longest row.
//! The rows of a causal tile are all cut in one vector, because a vector holds whole tiles.

use super::lanes::LANES;
use super::scratch::ROWS;

mod backward;
mod forward;
pub mod half;
mod head_rows;
mod heads;
mod rotation;
mod softmax;
mod workspace;

pub use backward::backward;
pub use forward::forward;
pub use heads::Heads;
pub use workspace::Workspace;

const _: () = assert!(LANES.is_multiple_of(ROWS), "a vector must hold whole tiles");

/// Attention of all sequences of `[q | k | v]`, `[n, d]`.
#[cfg(test)]
pub fn outcome(qkv: &[f32], heads: Heads<'_>) -> Vec<f32> {
    let mut output = vec![f32::NAN; heads.layout.n_rows() * heads.d_model()];
    let sequences = 0..heads.layout.n_sequences();
    forward(qkv, heads, sequences, &mut output, false, &mut &mut [][..], &mut Workspace::default());
    output
}
