//! The way forward: scores, softmax, weighted values.

use std::ops::Range;

use super::head_rows::HeadRows;
use super::rotation::rotate_back;
use super::sight::Sight;
use super::softmax::{self, Statistics, Tile};
use super::{Heads, Workspace};
use crate::ops::own::lanes::{Lanes, vectorised};
use crate::ops::own::product::{Span, block};
use crate::ops::own::scratch::ROWS;

vectorised! {
    /// Attention of the sequences `sequences` of `qkv` `[n, 3 d]`, into their rows of `output`
    /// `[n, d]`. If `keep` asks for it, what [`backward`](super::backward()) makes the weights from again
    /// goes to the front of `room`, and it moves on.
    pub fn forward(
        qkv: &[f32],
        heads: Heads<'_>,
        sequences: Range<usize>,
        output: &mut [f32],
        keep: bool,
        room: &mut &mut [f32],
        work: &mut Workspace,
    ) {
        for head in heads.each(sequences) {
            work.load::<L>(qkv, head);
            mix::<L>(work, &head, (&mut *output, head.output()), keep, room);
        }
    }
}

/// softmax(queries keysᵀ) values of the head that was read, tile after tile, into its rows.
#[inline(always)]
pub fn mix<L: Lanes>(
    work: &mut Workspace,
    sight: &impl Sight,
    (output, place): (&mut [f32], HeadRows),
    keep: bool,
    room: &mut &mut [f32],
) {
    work.weights.resize(ROWS, sight.n_keys());
    work.output.resize(ROWS, sight.head_dim());
    for first in (0..sight.n_queries()).step_by(ROWS) {
        let statistics = attend::<L>(work, sight, first);
        if keep {
            statistics.keep(sight.rows(first).len(), room);
        }
        let to = (&mut *output, place);
        rotate_back::<L>(to, &work.output, sight.rows(first), None, 1.0);
    }
}

/// weights = softmax(queries keysᵀ), output = weights values, for the rows of one tile.
#[inline(always)]
fn attend<L: Lanes>(work: &mut Workspace, sight: &impl Sight, first: usize) -> Statistics {
    let visible = sight.visible_in_tile(first);
    work.scores::<L>(sight, first, 0);
    let tile = Tile { first: 0, visible: sight.visible_by_row(first) };
    let statistics = softmax::forward::<L>(&mut work.weights, tile);
    let span = Span { inner: 0..visible, columns: sight.head_dim() };
    block::<L, _>(&mut work.output, 0, work.weights.plain(), &work.values, span);
    statistics
}
