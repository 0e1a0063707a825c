//! One head of one sequence: where it lies, and what its positions see.

use std::ops::Range;

use super::head_rows::HeadRows;
use super::rotation::Angles;
use super::sight::Sight;
use super::softmax::Statistics;
use crate::ops::{Rope, SequenceLayout};

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
pub struct Head<'a> {
    layout: &'a SequenceLayout,
    sequence: usize,
    rope: &'a Rope,
    d_model: usize,
    /// The first row of the sequence, in the slices that are worked on.
    row: usize,
    pub len: usize,
    /// First feature of the head within d_model.
    column: usize,
}

impl<'a> Heads<'a> {
    pub fn d_model(&self) -> usize {
        self.n_head * self.rope.head_dim()
    }

    /// Every head of these sequences, in the order of their rows.
    pub fn each(self, sequences: Range<usize>) -> impl Iterator<Item = Head<'a>> {
        sequences
            .flat_map(move |sequence| (0..self.n_head).map(move |head| self.at(sequence, head)))
    }

    /// Numbers kept for the way back.
    pub fn n_kept(self) -> usize {
        Statistics::PER_ROW * self.n_head * self.layout.n_rows()
    }

    fn at(self, sequence: usize, head: usize) -> Head<'a> {
        Head {
            layout: self.layout,
            sequence,
            rope: self.rope,
            d_model: self.d_model(),
            row: self.layout.rows(sequence).start - self.first_row,
            len: self.layout.len(sequence),
            column: head * self.rope.head_dim(),
        }
    }
}

impl Head<'_> {
    /// Where the head's part number `part` (0 q, 1 k, 2 v) lies in `[n_rows, 3 d]`.
    #[inline(always)]
    pub fn part(&self, part: usize) -> HeadRows {
        let stride = 3 * self.d_model;
        let start = self.row * stride + part * self.d_model + self.column;
        HeadRows { start, stride, columns: self.head_dim() }
    }

    /// Where the head's output lies in `[n_rows, d]`.
    #[inline(always)]
    pub fn output(&self) -> HeadRows {
        let start = self.row * self.d_model + self.column;
        HeadRows { start, stride: self.d_model, columns: self.head_dim() }
    }

    /// The angles of its positions.
    #[inline(always)]
    pub fn angles(&self) -> Angles<'_> {
        Angles { rope: self.rope, listed: self.layout.angles(self.sequence) }
    }
}

impl Sight for Head<'_> {
    #[inline(always)]
    fn head_dim(&self) -> usize {
        self.rope.head_dim()
    }

    #[inline(always)]
    fn n_queries(&self) -> usize {
        self.len
    }

    #[inline(always)]
    fn n_keys(&self) -> usize {
        self.len
    }

    #[inline(always)]
    fn visible(&self, q: usize) -> usize {
        self.layout.visible(self.sequence, q)
    }

    #[inline(always)]
    fn first_viewer(&self, k: usize) -> usize {
        self.layout.first_viewer(self.sequence, k)
    }
}
