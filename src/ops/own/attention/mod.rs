//! Rotary, prefix-causal attention over packed sequences, one head of one sequence at a time.
//!
//! The mask lets a position see the first so many positions of its sequence and no others, so
//! each row of the score matrix is cut where it ends, and only what lies before the cut is
//! computed and kept: about half of it for a causal sequence.
//!
//! Rows of weights are zero from their cut to the end of its vector, and unspecified after it.
//! That is enough: a tile reads no further than its longest row, whose cut lies in the same
//! vector, because a vector holds whole tiles and all rows of the prefix are equally long.

use std::ops::Range;

use crate::ops::{Rope, SequenceLayout};

use super::lanes::LANES;
use super::product::{ROWS, Scratch};

mod backward;
mod forward;
pub mod half;
mod rotation;

pub use backward::backward;
pub use forward::forward;

const _: () = assert!(LANES.is_multiple_of(ROWS), "a vector must hold whole tiles");

/// Where the heads of the sequences lie in rows of `[q | k | v]` and of the output.
#[derive(Clone, Copy)]
pub struct Heads<'a> {
    pub layout: &'a SequenceLayout,
    pub rope: &'a Rope,
    pub n_head: usize,
    /// The row of the batch at which the slices that are worked on start.
    pub first_row: usize,
}

/// One head of one sequence.
#[derive(Clone, Copy)]
struct Head<'a> {
    heads: Heads<'a>,
    sequence: usize,
    /// First feature of the head within d_model.
    column: usize,
}

/// Matrices of one head, kept from head to head for their allocations.
#[derive(Default)]
pub struct Workspace {
    /// Rotated and scaled, `[len, head_dim]`.
    queries: Scratch,
    /// One rotated key.
    turned: Scratch,
    /// Rotated: transposed, `[head_dim, len]`, on the way forward, `[len, head_dim]` back.
    keys: Scratch,
    /// `[len, head_dim]` on the way forward, transposed back.
    values: Scratch,
    /// Softmax of the scores, `[len, len]`, each row to the end of the vector it is cut in.
    weights: Scratch,
    /// Gradient by the weights, then by the scores, `[len, len]`.
    grad_scores: Scratch,
    /// The head's output or its gradient, `[len, head_dim]`.
    output: Scratch,
    /// Gradients by the rotated queries and keys and by the values, `[len, head_dim]`.
    grad_queries: Scratch,
    grad_keys: Scratch,
    grad_values: Scratch,
}

impl<'a> Heads<'a> {
    pub fn d_model(&self) -> usize {
        self.n_head * self.rope.head_dim()
    }

    /// Every head of these sequences, in the order of their rows.
    fn each(self, sequences: Range<usize>) -> impl Iterator<Item = Head<'a>> {
        sequences
            .flat_map(move |sequence| (0..self.n_head).map(move |head| self.at(sequence, head)))
    }

    /// Weights kept for the way back: rows of visible ones, filled up to whole vectors.
    pub fn n_kept(self) -> usize {
        let heads = self.each(0..self.layout.n_sequences());
        let rows = heads.flat_map(|head| (0..head.len()).map(move |q| head.visible(q)));
        rows.map(|visible| visible.next_multiple_of(LANES)).sum()
    }

    fn at(self, sequence: usize, head: usize) -> Head<'a> {
        Head { heads: self, sequence, column: head * self.rope.head_dim() }
    }
}

impl Head<'_> {
    fn len(&self) -> usize {
        self.heads.layout.len(self.sequence)
    }

    fn head_dim(&self) -> usize {
        self.heads.rope.head_dim()
    }

    fn scale(&self) -> f32 {
        (1.0 / (self.head_dim() as f64).sqrt()) as f32
    }

    #[inline(always)]
    fn visible(&self, q: usize) -> usize {
        self.heads.layout.visible(self.sequence, q)
    }

    /// Start of the head's part number `part` (0 q, 1 k, 2 v) of position `t` in `[n_rows, 3 d]`.
    #[inline(always)]
    fn start(&self, part: usize, t: usize) -> usize {
        let d_model = self.heads.d_model();
        let row = self.heads.layout.rows(self.sequence).start + t - self.heads.first_row;
        (3 * row + part) * d_model + self.column
    }

    /// The head's part number `part` of position `t`.
    #[inline(always)]
    fn part<'q>(&self, part: usize, t: usize, qkv: &'q [f32]) -> &'q [f32] {
        &qkv[self.start(part, t)..][..self.head_dim()]
    }

    /// Start of the head's output of position `t` in `[n_rows, d]`.
    #[inline(always)]
    fn output_start(&self, t: usize) -> usize {
        let row = self.heads.layout.rows(self.sequence).start + t - self.heads.first_row;
        row * self.heads.d_model() + self.column
    }

    /// Most positions seen by a row of the tile that starts at row `first`.
    #[inline(always)]
    fn visible_in_tile(&self, first: usize) -> usize {
        self.visible((first + ROWS).min(self.len()) - 1).max(self.visible(first))
    }

    /// The first position that sees a position of the tile that starts at `first`.
    #[inline(always)]
    fn first_viewer(&self, first: usize) -> usize {
        if first < self.heads.layout.prefix(self.sequence) { 0 } else { first }
    }
}

/// Attention of all sequences of `[q | k | v]`, `[n, d]`.
#[cfg(test)]
pub fn outcome(qkv: &[f32], heads: Heads<'_>) -> Vec<f32> {
    let mut output = vec![f32::NAN; heads.layout.n_rows() * heads.d_model()];
    let sequences = 0..heads.layout.n_sequences();
    forward(qkv, heads, sequences, &mut output, false, &mut &mut [][..], &mut Workspace::default());
    output
}
