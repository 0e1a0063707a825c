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

use super::buffers::Buffer;
use super::lanes::LANES;
use super::scratch::ROWS;

mod backward;
mod cross;
mod forward;
pub mod half;
mod head_rows;
mod heads;
mod rotation;
mod sight;
mod softmax;
mod workspace;

pub use backward::backward;
pub use cross::{CrossHeads, cross, cross_back};
pub use forward::forward;
pub use heads::Heads;
pub use workspace::Workspace;

const _: () = assert!(LANES.is_multiple_of(ROWS), "a vector must hold whole tiles");

/// Attention of all sequences of `[q | k | v]`, `[n, d]`, and, if `keep` asks for it, what makes its
/// weights again.
pub fn alone(qkv: &[f32], heads: Heads<'_>, keep: bool) -> (Buffer, Buffer) {
    let mut output = Buffer::new(heads.layout.n_rows() * heads.d_model());
    let mut kept = Buffer::new(if keep { heads.n_kept() } else { 0 });
    let (sequences, mut room) = (0..heads.layout.n_sequences(), &mut kept[..]);
    forward(qkv, heads, sequences, &mut output, keep, &mut room, &mut Workspace::default());
    (output, kept)
}

/// The gradient by `[q | k | v]`, given the gradient by the output and what [`alone`] kept.
pub fn alone_back(qkv: &[f32], heads: Heads<'_>, kept: &[f32], gradient: &[f32]) -> Buffer {
    let mut by_qkv = Buffer::from_slice(qkv);
    let (sequences, mut kept) = (0..heads.layout.n_sequences(), kept);
    backward(&mut by_qkv, heads, sequences, &mut kept, gradient, &mut Workspace::default());
    by_qkv
}
